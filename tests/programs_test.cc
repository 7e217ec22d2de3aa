// SPDX-License-Identifier: Apache-2.0
// The programs as a person uses them: exit codes, messages, and nothing half-written.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <utility>

#include "base/files.h"
#include "base/image_files.h"
#include "base/safetensors.h"
#include "tests/programs_fixture.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;

/// An empty folder that programs take for their temporary files while this lives.
class Scratch {
 public:
  explicit Scratch(fs::path path) : path_(std::move(path)) {
    if (const char* before = std::getenv("TMPDIR")) before_ = before;
    fs::create_directory(path_);
    ::setenv("TMPDIR", path_.c_str(), 1);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch() {
    if (before_) {
      ::setenv("TMPDIR", before_->c_str(), 1);
    } else {
      ::unsetenv("TMPDIR");
    }
  }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
  std::optional<std::string> before_;
};

// A measured view, one between measured ones, a light, and what there is no data for.
TEST_F(ProgramsTest, FitsForOneViewOrOneLight) {
  const std::string fit = "veneer fit " + text("cloth.btfset") +
                          " --model texel-colours --components 1+1 --clusters 2 --angular 8 -o " +
                          text("fixed.safetensors");
  for (const char* fixed : {" --fixed-view 0,0", " --fixed-view 7.5,100", " --fixed-light 20,45"}) {
    const Outcome outcome = run(fit + fixed);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    ASSERT_TRUE(fs::exists(at("fixed.safetensors")));
    EXPECT_LT(fs::file_size(at("fixed.safetensors")),
              fs::file_size(at("material.safetensors")) / 4);
    fs::remove(at("fixed.safetensors"));
  }
  EXPECT_TRUE(fails(run(fit + " --fixed-view 89,0"), 2, "beyond its measured views"));
  EXPECT_TRUE(fails(run(fit + " --fixed-light nan,0"), 2, "not a direction"));
  EXPECT_TRUE(fails(run(fit + " --fixed-view 10"), 2, "--fixed-view"));
  for (const auto& entry : fs::directory_iterator(folder_->path()))
    EXPECT_EQ(entry.path().filename().string().find("fixed"), std::string::npos) << entry.path();
}

TEST_F(ProgramsTest, UnknownCommandsAndOptionsAreWrongUsage) {
  EXPECT_TRUE(fails(run("veneer"), 2, "usage"));
  EXPECT_TRUE(fails(run("veneer paint"), 2, "no command \"paint\""));
  EXPECT_TRUE(fails(run("veneer fit --colour"), 2, "required"));
  EXPECT_TRUE(fails(run("veneerd --colour"), 2, "--colour"));
  EXPECT_EQ(run("veneer --help").exit_code, 0);
  EXPECT_EQ(run("veneer fit --help").exit_code, 0);
}

TEST_F(ProgramsTest, MissingFilesAreNamed) {
  EXPECT_TRUE(
      fails(run("veneer fit nothing.btfset --model lpca -o " + text("x")), 1, "nothing.btfset"));
  EXPECT_TRUE(fails(run("veneer evaluate " + text("cloth.btfset") + " nothing.safetensors"),
                    1,
                    "nothing.safetensors"));
  EXPECT_TRUE(fails(run("veneerd --config nothing.toml"), 1, "nothing.toml"));
  EXPECT_TRUE(fails(run("veneer import rti nothing.lp -o " + text("x")), 1, "nothing.lp"));
  ASSERT_TRUE(write_text(at("short.binary"), "no table"));
  EXPECT_TRUE(fails(
      run("veneer import merl " + text("short.binary") + " -o " + text("x")), 1, "short.binary"));
  EXPECT_FALSE(fs::exists(at("x")));
}

TEST_F(ProgramsTest, UnknownModelsAreAnsweredWithTheKnownOnes) {
  EXPECT_TRUE(fails(run("veneer fit " + text("cloth.btfset") + " --model magic -o " + text("x")),
                    2,
                    "texel-colours"));
  EXPECT_FALSE(fs::exists(at("x")));
}

TEST_F(ProgramsTest, OptionsThatAModelCannotDoAreWrongUsage) {
  for (const char* option :
       {"--clusters 0", "--components 0", "--components 3+", "--components -1", "--angular 1"}) {
    EXPECT_TRUE(fails(run("veneer fit " + text("cloth.btfset") + " --model texel-colours -o " +
                          text("x") + " " + option),
                      2,
                      ""))
        << option;
    EXPECT_FALSE(fs::exists(at("x"))) << option;
  }
}

TEST_F(ProgramsTest, ATruncatedMaterialIsRefused) {
  fs::copy_file(
      at("material.safetensors"), at("cut.safetensors"), fs::copy_options::overwrite_existing);
  cut_in_half(at("cut.safetensors"));
  EXPECT_TRUE(fails(run("veneer evaluate " + text("cloth.btfset") + " " + text("cut.safetensors")),
                    1,
                    "cut short"));
}

TEST_F(ProgramsTest, ATruncatedSampleSetIsRefused) {
  const fs::path set = copy_of_set("cut.btfset");
  cut_in_half(set / "samples.safetensors");
  EXPECT_TRUE(
      fails(run("veneer fit " + set.string() + " --model lpca -o " + text("x")), 1, "cut short"));
  EXPECT_FALSE(fs::exists(at("x")));
}

TEST_F(ProgramsTest, ASetWhoseSamplesDoNotMatchItsDirectionsIsRefused) {
  const fs::path set = copy_of_set("short.btfset");
  const std::string views = read_text(set / "views.csv").value();
  ASSERT_TRUE(
      write_text(set / "views.csv", views.substr(0, views.rfind('\n', views.size() - 2) + 1)));
  EXPECT_TRUE(
      fails(run("veneer fit " + set.string() + " --model lpca -o " + text("x")), 1, "samples"));
  EXPECT_FALSE(fs::exists(at("x")));
}

TEST_F(ProgramsTest, SamplesThatAreNoNumbersAreRefusedWithTheirPlace) {
  const fs::path set = copy_of_set("nan.btfset");
  std::fstream file(set / "samples.safetensors", std::ios::in | std::ios::out | std::ios::binary);
  const auto end = static_cast<std::streamoff>(fs::file_size(set / "samples.safetensors"));
  file.seekp(end - 2);
  file.write("\x00\x7e", 2);  // float16 NaN, the last sample of the last texel
  file.close();
  EXPECT_TRUE(fails(
      run("veneer fit " + set.string() + " --model texel-colours --components 3+1 -o " + text("x")),
      1,
      "63"));
  EXPECT_FALSE(fs::exists(at("x")));
}

TEST_F(ProgramsTest, VerifyRefusesARunWithoutFramesAndOneOfAnotherMesh) {
  const std::string config = text("veneer.toml");
  ASSERT_EQ(run("veneerd --config " + config + " --set frames=1").exit_code, 0);
  const std::string verify = "veneer verify --bench " VENEER_ETC "/benches/demo.toml --set " +
                             text("cloth.btfset") + " --run " + folder_->path().string();
  ASSERT_TRUE(write_text(at("frames") / "frames.jsonl", ""));
  EXPECT_TRUE(fails(run(verify), 1, "no frames"));
  std::string scene = read_text(at("scene.toml")).value();
  scene.replace(scene.find("\"sphere\""), 8, "\"vase\"");
  ASSERT_TRUE(write_text(at("vase.toml"), scene));
  ASSERT_EQ(
      run("veneerd --config " + config + " --set frames=1 --set 'scene=\"vase.toml\"'").exit_code,
      0);
  EXPECT_TRUE(fails(run(verify), 2, "vase"));
}

TEST_F(ProgramsTest, TheDemoLeavesAForeignFolderAlone) {
  ASSERT_TRUE(write_text(at("mine") / "pictures" / "holiday.png", "precious"));
  EXPECT_TRUE(fails(run("veneer demo --out " + text("mine")), 2, "name another folder"));
  EXPECT_TRUE(fs::exists(at("mine") / "pictures" / "holiday.png"));
}

TEST_F(ProgramsTest, JsonIsAloneOnStandardOutput) {
  const Outcome outcome = run("veneer evaluate " + text("cloth.btfset") + " " +
                              text("material.safetensors") + " --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  for (const char* key : {"epsilon_avg", "epsilon_min", "epsilon_max", "rmse"}) {
    EXPECT_GE(json.at("encoded").at(key), 0.0) << key;
    EXPECT_GE(json.at("linear").at(key), 0.0) << key;
  }
  EXPECT_GT(json.at("fetches"), 0);
  EXPECT_NE(outcome.err.find("done in"), std::string::npos) << "progress goes to standard error";
  EXPECT_TRUE(run("veneer evaluate " + text("cloth.btfset") + " " + text("material.safetensors") +
                  " --json --quiet")
                  .err.empty());
}

TEST_F(ProgramsTest, CompareGivesThePublishedTablesOfASet) {
  const Outcome outcome = run("veneer compare " + text("cloth.btfset") +
                              " --tables --models lpca,phong --size 64x48 --frames 3 --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(json.at("models").size(), 2U);
  const auto& lpca = json.at("models").at(0);
  EXPECT_EQ(lpca.at("published").at("label"), "LPCA");
  EXPECT_DOUBLE_EQ(lpca.at("values_per_texel"), 1 + 8 + 3 * 25 * 25 * 8 * 32 / 64.0);
  EXPECT_LE(lpca.at("epsilon").at("min"), lpca.at("epsilon").at("avg"));
  EXPECT_LE(lpca.at("epsilon").at("avg"), lpca.at("epsilon").at("max"));
  EXPECT_GT(json.at("models").at(1).at("epsilon").at("avg"), lpca.at("epsilon").at("avg"));
  EXPECT_TRUE(json.at("published_material").is_null());
  EXPECT_TRUE(json.at("values_differ").empty());
  EXPECT_GT(lpca.at("ms_median"), 0.0);
  EXPECT_GT(json.at("plain_ms"), 0.0);

  EXPECT_EQ(run("veneer compare " + text("cloth.btfset") + " --tables 2 --models phong -o " +
                text("tables.md"))
                .exit_code,
            0);
  const std::string tables = read_text(at("tables.md")).value();
  EXPECT_NE(tables.find("### Table 2"), std::string::npos) << tables;
  EXPECT_EQ(tables.find("### Table 3"), std::string::npos) << tables;
  EXPECT_TRUE(fails(
      run("veneer compare " + text("cloth.btfset") + " --models granite"), 2, "there is no model"));
}

TEST_F(ProgramsTest, CompareSaysHowFarModelsAreOffWhereNoFitSaw) {
  const Scratch scratch(at("scratch"));
  const std::string compare = "veneer compare " + text("cloth.btfset") + " --tables 2 --models ";
  const Outcome outcome = run(compare + "lpca,phong --held-out 60 --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("2 of 2: phong, without the views beyond 60 degrees"),
            std::string::npos)
      << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json.at("held_out_beyond_deg"), 60.0);
  ASSERT_EQ(json.at("models").size(), 2U);
  for (const auto& model : json.at("models")) {
    const auto& held_out = model.at("held_out");
    EXPECT_EQ(held_out.at("texels"), 64);
    EXPECT_EQ(
        held_out.at("beyond").at("views").get<int>() + held_out.at("within").at("views").get<int>(),
        25);
    EXPECT_GT(held_out.at("beyond").at("epsilon"), 0.0);
  }
  // What holds nearly all of the fitted views holds less of the others.
  const auto& lpca = json.at("models").at(0).at("held_out");
  EXPECT_GT(lpca.at("beyond").at("epsilon"), lpca.at("within").at("epsilon"));
  EXPECT_TRUE(fs::is_empty(scratch.path())) << "the set without grazing views is still there";

  // Nor does a fit that fails leave anything.
  EXPECT_TRUE(fails(run(compare + "lpca:9999 --held-out 60"), 2, "components"));
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST_F(ProgramsTest, CompareRefusesAnglesThatHoldOutNothing) {
  const std::string compare =
      "veneer compare " + text("cloth.btfset") + " --tables 2 --models phong --held-out ";
  EXPECT_TRUE(fails(run(compare + "80"), 2, "the furthest from the normal is at 75"));
  EXPECT_TRUE(fails(run(compare + "91"), 2, "--held-out"));
  EXPECT_TRUE(fails(run(compare + "nan"), 2, "between 0 and 90 degrees"));
}

TEST_F(ProgramsTest, AGovernorIsNotTimedWhereNothingCanBeSeen) {
  EXPECT_TRUE(fails(run("veneer bench governor --size 8x8"), 2, "--size 8x8"));
  EXPECT_TRUE(fails(run("veneer bench governor --size 128"), 2, "WIDTHxHEIGHT"));
  EXPECT_TRUE(fails(run("veneer bench governor --seconds 5"), 2, "--seconds 5"));
  EXPECT_TRUE(fails(run("veneer bench governor --busy -1"), 2, "--busy"));
}

TEST_F(ProgramsTest, VerifyingALaterRunSeesWhatCompensationIsWorth) {
  const std::string config = text("veneer.toml");
  ASSERT_EQ(run("veneerd --config " + config + " --set frames=2").exit_code, 0);
  const std::string verify = "veneer verify --json --quiet --bench " VENEER_ETC
                             "/benches/demo.toml --set " +
                             text("cloth.btfset") + " --run " + folder_->path().string();
  const Outcome compensated = run(verify);
  ASSERT_EQ(compensated.exit_code, 0) << compensated.err;
  // Held against what was meant to be drawn, the error of the fit is gone.
  const Outcome fitted =
      run("veneer verify --json --quiet --bench " VENEER_ETC "/benches/demo.toml --material " +
          text("material.safetensors") + " --run " + folder_->path().string());
  ASSERT_EQ(fitted.exit_code, 0) << fitted.err;
  const nlohmann::json chain = nlohmann::json::parse(fitted.out);
  EXPECT_LT(chain.at("de00_mean").get<double>(),
            nlohmann::json::parse(compensated.out).at("de00_mean").get<double>());
  // The whole chain, from a projector that the wizard measured to the eye; texels are many pixels
  // wide here, so that what a projector cannot resolve does not count. Measured: see
  // docs/measured.md.
  EXPECT_LE(chain.at("de00_mean").get<double>(), 1.0);
  EXPECT_LE(chain.at("de00_p95").get<double>(), 2.5);
  ASSERT_EQ(
      run("veneerd --config " + config + " --set frames=2 --set render.compensate=false").exit_code,
      0);
  const Outcome raw = run(verify);
  ASSERT_EQ(raw.exit_code, 0) << raw.err;
  // Eight texels say little about colour; but compensation must be worth a lot even so.
  EXPECT_GT(nlohmann::json::parse(raw.out).at("de00_mean").get<double>(),
            2 * nlohmann::json::parse(compensated.out).at("de00_mean").get<double>());
}

TEST_F(ProgramsTest, RenderWritesAPictureOrALuminanceImage) {
  const std::string line = "veneer render " + text("scene.toml") + " --material " +
                           text("material.safetensors") + " --profile " + text("profile") +
                           " --eye 0,0.2,0.9 -o ";
  EXPECT_EQ(run(line + text("frame.png")).exit_code, 0);
  EXPECT_EQ(run(line + text("frame.exr")).exit_code, 0);
  EXPECT_TRUE(fs::exists(at("frame.png")));
  EXPECT_TRUE(fs::exists(at("frame.exr")));
  EXPECT_TRUE(fails(run(line + text("frame.bmp")), 2, ".png or .exr"));
}

TEST_F(ProgramsTest, RenderShowsWhatAnEyeSees) {
  const auto line = [](const char* material) {
    return "veneer render " + text("scene.toml") + " --material " + text(material) +
           " --eye 0,0.2,0.9 --json -o " + text("seen.exr") + " ";
  };
  const std::string eye = "--from-eye --size 64x48 ";
  const auto brightest = [] {
    const auto picture = read_exr_rgb(at("seen.exr"), {"X", "Y", "Z"});
    EXPECT_TRUE(picture) << picture.error().what;
    float most = 0;
    if (picture)
      for (const Rgb32f& pixel : picture->pixels()) most = std::max(most, pixel.maxCoeff());
    return most;
  };
  const Outcome plain = run(line("material.safetensors") + eye + "--white 100");
  ASSERT_EQ(plain.exit_code, 0) << plain.err;
  EXPECT_EQ(nlohmann::json::parse(plain.out).at("white_nits"), 100);
  EXPECT_GT(brightest(), 1.0F);
  const auto channels = read_exr(at("seen.exr"));
  ASSERT_TRUE(channels) << channels.error().what;
  EXPECT_EQ(channels->size(), 4U);

  ASSERT_EQ(run("veneer fit " + text("cloth.btfset") + " --model layered -o " +
                text("layered.safetensors"))
                .exit_code,
            0);
  const Outcome shells = run(line("layered.safetensors") + eye + "--shells");
  ASSERT_EQ(shells.exit_code, 0) << shells.err;
  EXPECT_GT(nlohmann::json::parse(shells.out).at("texel_mm").at("mean"), 0.0);

  const std::string projector = "--profile " + text("profile") + " ";
  EXPECT_TRUE(fails(run(line("material.safetensors") + eye + "--shells"), 2, "model layered"));
  EXPECT_TRUE(fails(run(line("material.safetensors") + eye + projector), 2, "--from-eye"));
  EXPECT_TRUE(fails(run(line("layered.safetensors") + projector + "--shells"), 2, "--from-eye"));
  EXPECT_TRUE(fails(run(line("material.safetensors")), 2, "--profile"));
  EXPECT_TRUE(fails(run(line("material.safetensors") + "--from-eye --size 64"), 2, "WIDTHxHEIGHT"));
  EXPECT_TRUE(fails(run(line("material.safetensors") + eye + "--white -1"), 2, "--white"));
  EXPECT_TRUE(fails(run(line("material.safetensors") + eye + "--samples 9"), 2, "1 to 8"));
}

}  // namespace
}  // namespace veneer
