// SPDX-License-Identifier: Apache-2.0
// A fit over the processes of mpirun: the same material, and none where a process dies.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <optional>
#include <thread>

#include "base/exit_code.h"
#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "btf/material.h"
#include "tests/program_child.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMpirun = VENEER_MPIRUN;
// Root mean square difference of samples, which are at most about 1.
constexpr double kSameMaterial = 1e-5;

btf::DirectionSet directions(int rings, int around) {
  btf::DirectionSet set;
  for (int ring = 0; ring < rings; ++ring)
    for (int i = 0; i < around; ++i) {
      const double theta = 1.2 * (ring + 0.5) / rings;
      const double phi = 6.283 * i / around;
      set.emplace_back(
          std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
    }
  return set;
}

// As many texels as two processes share in whole chunks. They are mixtures of a few functions of
// direction, and a little noise.
void write_set(const fs::path& path, bool polarised) {
  btf::SampleSetInfo info;
  info.width = info.height = 64;
  info.polarised = polarised;
  info.views = directions(2, 4);
  info.lights = directions(2, 5);
  auto writer = btf::SampleSetWriter::create(path, info);
  ASSERT_TRUE(writer) << writer.error().what;
  const auto values = static_cast<Eigen::Index>(info.pair_count()) * info.channel_count();
  constexpr int kFunctions = 12;
  Pcg32 random(1);
  Eigen::MatrixXf functions(kFunctions, values);
  for (float& value : functions.reshaped()) value = static_cast<float>(random.uniform());
  for (int texel = 0; texel < info.texel_count(); ++texel) {
    Eigen::RowVectorXf samples = Eigen::RowVectorXf::Zero(values);
    for (int f = 0; f < 3; ++f)
      samples += static_cast<float>(random.uniform() / 3.0) *
                 functions.row(static_cast<Eigen::Index>(random.next() % kFunctions));
    const std::span<Eigen::half> out = writer->texel(texel);
    for (Eigen::Index i = 0; i < values; ++i)
      out[static_cast<std::size_t>(i)] =
          Eigen::half(samples[i] + 0.01F * static_cast<float>(random.uniform()));
  }
  const Status status = writer->finish();
  ASSERT_TRUE(status) << status.error().what;
}

class MpiFit : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    write_set(at("set.btfset"), false);
    write_set(at("polarised.btfset"), true);
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  void SetUp() override {
    if (kMpirun.empty()) GTEST_SKIP() << "no MPI: this build's fits run in one process";
  }

  static fs::path at(const std::string& name) { return folder_->path() / name; }

  /// Starts `veneer ARGUMENTS` on so many processes of one thread; standard error goes to `err`.
  static pid_t start(int processes, const std::string& arguments) {
    const std::string launcher =
        processes == 1
            ? std::string()
            : fmt::format("{} --allow-run-as-root --oversubscribe -n {} ", kMpirun, processes);
    const std::string line = fmt::format("VENEER_THREADS=1 exec {}{}/veneer {} >{} 2>{} </dev/null",
                                         launcher,
                                         VENEER_PROGRAMS,
                                         arguments,
                                         at("out").string(),
                                         at("err").string());
    return start_shell(line);
  }
  static std::string errors() { return read_text(at("err")).value_or(""); }

  static std::unique_ptr<btf::Material> fit(int processes, const std::string& arguments) {
    const fs::path out = at(fmt::format("on{}.safetensors", processes));
    fs::remove(out);
    EXPECT_EQ(wait_for(start(processes, "fit -o " + out.string() + " " + arguments)), kExitDone)
        << errors();
    auto material = btf::load_material(out);
    EXPECT_TRUE(material) << material.error().what;
    return material ? std::move(*material) : nullptr;
  }

  static TemporaryFolder* folder_;
};
TemporaryFolder* MpiFit::folder_ = nullptr;

double difference(const btf::Material& a, const btf::Material& b) {
  const std::size_t values = a.views().size() * a.lights().size() * 3;
  Eigen::VectorXf from_a(values);
  Eigen::VectorXf from_b(values);
  double sum = 0.0;
  const int texels = a.width() * a.height();
  for (int texel = 0; texel < texels; ++texel) {
    a.reconstruct(texel, {from_a.data(), values});
    b.reconstruct(texel, {from_b.data(), values});
    sum += (from_a - from_b).cast<double>().squaredNorm();
  }
  return std::sqrt(sum / (static_cast<double>(values) * texels));
}

TEST_F(MpiFit, TheMaterialIsThatOfOneProcess) {
  for (const auto& [model, set, components] :
       {std::tuple{"lpca", "set.btfset", "3"},
        std::tuple{"texel-colours", "set.btfset", "2+1 --angular 4"},
        std::tuple{"dichromatic-lpca", "polarised.btfset", "2+1 --angular 4"}}) {
    const std::string arguments =
        fmt::format("{} --model {} --clusters 4 --iterations 4 --components {}",
                    at(set).string(),
                    model,
                    components);
    const auto one = fit(1, arguments);
    ASSERT_NE(one, nullptr) << model;
    const auto two = fit(2, arguments);
    ASSERT_NE(two, nullptr) << model;
    EXPECT_LT(difference(*one, *two), kSameMaterial) << model;
  }
}

TEST_F(MpiFit, AnErrorIsToldOnce) {
  for (const auto& [arguments, message, exit_code] :
       {std::tuple{"--model lpca " + at("absent.btfset").string(), "no such folder", kExitFailed},
        std::tuple{"--model lafortune " + at("set.btfset").string(),
                   "not shared among processes",
                   kExitUsage}}) {
    EXPECT_EQ(wait_for(start(2, "fit -o " + at("none").string() + " " + arguments)), exit_code);
    const std::string text = errors();
    const std::size_t first = text.find(message);
    ASSERT_NE(first, std::string::npos) << text;
    EXPECT_EQ(text.find(message, first + 1), std::string::npos) << text;
    EXPECT_FALSE(fs::exists(at("none")));
  }
}

// The process of a rank that writes to `out`, by what /proc says of it.
std::optional<pid_t> process_of_rank(int rank, const std::string& out) {
  const std::string wanted = fmt::format("OMPI_COMM_WORLD_RANK={}", rank);
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/proc", ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const std::string arguments = read_text(entry.path() / "cmdline").value_or("");
    if (arguments.find(out) == std::string::npos || arguments.find("mpirun") != std::string::npos)
      continue;
    const std::string environment = read_text(entry.path() / "environ").value_or("");
    if (('\0' + environment).find('\0' + wanted + '\0') != std::string::npos)
      return std::stoi(name);
  }
  return std::nullopt;
}

TEST_F(MpiFit, ADeadProcessEndsTheJobAndLeavesNoMaterial) {
  fs::create_directory(at("killed"));
  const fs::path out = at("killed/material.safetensors");
  // Work for many seconds, were it not ended.
  const pid_t job = start(2,
                          fmt::format("fit {} --model lpca --clusters 200 --components 8 -o {}",
                                      at("set.btfset").string(),
                                      out.string()));
  std::optional<pid_t> rank;
  for (int i = 0; i < 1000 && !rank; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    rank = process_of_rank(1, out.string());
  }
  ASSERT_TRUE(rank);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  ASSERT_EQ(::kill(*rank, SIGKILL), 0);
  EXPECT_NE(wait_for(job), kExitDone);
  EXPECT_NE(errors().find("signal 9"), std::string::npos) << errors();
  EXPECT_TRUE(fs::is_empty(at("killed")));
}

}  // namespace
}  // namespace veneer
