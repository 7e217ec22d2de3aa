// SPDX-License-Identifier: Apache-2.0
#include "capture/recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <fstream>

#include "base/files.h"
#include "base/image_files.h"
#include "base/random.h"
#include "base/testing/full_disk.h"
#include "base/testing/temporary_folder.h"

namespace veneer::capture {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

CapturePlan small_plan() {
  CapturePlan plan;
  plan.name = "cloth";
  plan.area.width_mm = 40;
  plan.area.height_mm = 30;
  plan.lights = {btf::Direction(0, 0, 1), btf::Direction(0.6, 0, 0.8)};
  plan.views = {btf::Direction(0, 0, 1)};
  return plan;
}

const std::string kCamera = "mock 1";

Picture picture_of(const Shot& shot, bool colour = false) {
  Picture picture;
  picture.shot = shot;
  picture.counts = Image<Rgb32f>(5, 4);
  Pcg32 random(static_cast<std::uint64_t>(shot.light * 10 + shot.exposure + 1));
  for (Rgb32f& pixel : picture.counts.pixels()) {
    const auto value = static_cast<float>(random.next() % 4096) / 3;
    pixel = Rgb32f(value, value, colour ? value + 0.5F : value);
  }
  picture.full_scale = 4095;
  picture.exposure_s = 1.0 / 30;
  picture.frames = 3;
  picture.time = Time{Duration{1234567890123456789}};
  return picture;
}

std::vector<Shot> some_shots() {
  std::vector<Shot> shots;
  for (int i = 0; i < 4; ++i) shots.push_back({Target::kSample, 0, i % 2, i / 2, i, i == 3});
  return shots;
}

void expect_same(const Picture& a, const Picture& b) {
  EXPECT_EQ(a.shot, b.shot);
  EXPECT_TRUE(std::ranges::equal(a.counts.pixels(), b.counts.pixels()));
  EXPECT_EQ(a.full_scale, b.full_scale);
  EXPECT_EQ(a.exposure_s, b.exposure_s);
  EXPECT_EQ(a.frames, b.frames);
  EXPECT_EQ(a.mosaic, b.mosaic);
  EXPECT_EQ(a.time, b.time);
}

TEST(Recording, KeepsPicturesBitByBit) {
  const TemporaryFolder folder;
  std::vector<Picture> pictures;
  for (const Target target :
       {Target::kSample, Target::kWhite, Target::kMirror, Target::kMirrorBall}) {
    pictures.push_back(picture_of({target, 0, 1, 1, 2, false}, target == Target::kWhite));
    pictures.push_back(picture_of({target, 0, 1, 0, 2, true}));
  }
  pictures.back().mosaic = Mosaic::kPolarColour;
  {
    auto recording = Recording::resume(folder.path() / "s", small_plan(), kCamera);
    ASSERT_TRUE(recording) << recording.error().what;
    for (const Picture& each : pictures) {
      EXPECT_FALSE(recording->has(each.shot));
      ASSERT_TRUE(recording->add(each));
      EXPECT_TRUE(recording->has(each.shot));
    }
    ASSERT_TRUE(recording->note("bracket", "[0.1, 1e-300]"));
    ASSERT_TRUE(recording->note("bracket", "[0.2,1e-300]"));  // the later one counts
    EXPECT_FALSE(recording->note("bracket", "no json"));
  }
  for (const bool resume : {false, true}) {
    const auto recording = resume ? Recording::resume(folder.path() / "s", small_plan(), kCamera)
                                  : Recording::open(folder.path() / "s");
    ASSERT_TRUE(recording) << recording.error().what;
    EXPECT_EQ(recording->camera(), kCamera);
    EXPECT_EQ(recording->plan().name, "cloth");
    EXPECT_EQ(recording->plan().lights, small_plan().lights);
    EXPECT_EQ(recording->shots().size(), pictures.size());
    const std::vector<Shot> shots = recording->shots();
    EXPECT_TRUE(std::ranges::is_sorted(shots));
    for (const Picture& each : pictures) {
      const auto read = recording->picture(each.shot);
      ASSERT_TRUE(read) << read.error().what;
      expect_same(*read, each);
    }
    EXPECT_EQ(recording->noted("bracket"), "[0.2,1e-300]");
    EXPECT_EQ(recording->noted("movement"), "");
    EXPECT_TRUE(recording->warnings().empty());
    EXPECT_EQ(recording->picture({Target::kSample, 0, 0, 0, 0, false}).error().code,
              Errc::kNotFound);
  }
}

TEST(Recording, SaysInThePictureWhatItIs) {
  const TemporaryFolder folder;
  auto recording = Recording::resume(folder.path(), small_plan(), kCamera);
  ASSERT_TRUE(recording) << recording.error().what;
  const Shot shot{Target::kSample, 0, 1, 1, 2, false};
  ASSERT_TRUE(recording->add(picture_of(shot)));
  EXPECT_EQ(recording->path_of(shot),
            folder.path() / "sample/view-00/light-01/analyser-1-exposure-2.exr");
  auto exr = read_exr_picture(recording->path_of(shot));
  ASSERT_TRUE(exr);
  EXPECT_EQ(exr->channels.size(), 1U);  // a grey one is stored once
  EXPECT_EQ(exr->attributes["veneer.target"], "sample");
  EXPECT_EQ(exr->attributes["veneer.light"], "1");
  EXPECT_EQ(std::stod(exr->attributes["veneer.exposure_s"]), 1.0 / 30);
  EXPECT_EQ(std::stod(exr->attributes["veneer.analyser_rad"]),
            small_plan().polarisation.analyser_rad[1]);
  EXPECT_EQ(exr->attributes["veneer.camera"], kCamera);
  EXPECT_EQ(exr->attributes["veneer.written"].size(), std::string("2026-01-01T00:00:00Z").size());
}

// Killed at any byte: what had its whole line is there, and it can be gone on with.
TEST(Recording, SurvivesAJournalThatIsCutAnywhere) {
  const TemporaryFolder folder;
  {
    auto recording = Recording::resume(folder.path(), small_plan(), kCamera);
    ASSERT_TRUE(recording);
    for (const Shot& shot : some_shots()) ASSERT_TRUE(recording->add(picture_of(shot)));
    ASSERT_TRUE(recording->note("bracket", "[1]"));
  }
  const fs::path journal = folder.path() / "journal.jsonl";
  const std::string whole = read_text(journal).value();
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    for (const bool zeros : {false, true}) {
      std::string left = whole.substr(0, length);
      const auto lines = static_cast<std::size_t>(std::ranges::count(left, '\n'));
      if (zeros) left += std::string(7, '\0');  // a file system may keep the length, lose the bytes
      std::ofstream(journal, std::ios::binary) << left;  // without the wait for the disk
      const auto read = Recording::open(folder.path());
      ASSERT_TRUE(read) << length << ": " << read.error().what;
      EXPECT_EQ(read_text(journal).value(), left);  // nothing lost by looking
      const auto resumed = Recording::resume(folder.path(), small_plan(), kCamera);
      ASSERT_TRUE(resumed) << length << ": " << resumed.error().what;
      for (const Recording* each : {&*read, &*resumed}) {
        EXPECT_EQ(each->shots().size(), std::min<std::size_t>(lines, 4)) << length;
        EXPECT_EQ(each->noted("bracket"), lines == 5 ? "[1]" : "") << length;
      }
    }
  }
  ASSERT_TRUE(write_text(journal, whole.substr(0, whole.size() / 2)));
  {
    auto resumed = Recording::resume(folder.path(), small_plan(), kCamera);
    ASSERT_TRUE(resumed);
    for (const Shot& shot : some_shots()) {
      if (resumed->has(shot)) continue;
      ASSERT_TRUE(resumed->add(picture_of(shot)));
    }
  }
  const auto again = Recording::open(folder.path());
  ASSERT_TRUE(again);
  for (const Shot& shot : some_shots()) {
    const auto read = again->picture(shot);
    ASSERT_TRUE(read) << read.error().what;
    expect_same(*read, picture_of(shot));
  }
}

TEST(Recording, RefusesDamageInTheJournalsMiddle) {
  const TemporaryFolder folder;
  {
    auto recording = Recording::resume(folder.path(), small_plan(), kCamera);
    ASSERT_TRUE(recording);
    for (const Shot& shot : some_shots()) ASSERT_TRUE(recording->add(picture_of(shot)));
  }
  const fs::path journal = folder.path() / "journal.jsonl";
  std::string text = read_text(journal).value();
  text[text.find('\n') + 3] = '\1';
  ASSERT_TRUE(write_text(journal, text));
  EXPECT_EQ(Recording::open(folder.path()).error().code, Errc::kBadFormat);
  const auto resumed = Recording::resume(folder.path(), small_plan(), kCamera);
  ASSERT_FALSE(resumed);
  EXPECT_EQ(resumed.error().code, Errc::kBadFormat);
  EXPECT_THAT(resumed.error().what, HasSubstr("damaged at byte"));
  EXPECT_EQ(read_text(journal).value(), text);
}

// A file that is gone, cut or changed.
TEST(Recording, NoticesAPictureThatIsNotWhatWasWritten) {
  const TemporaryFolder folder;
  const std::vector<Shot> shots = some_shots();
  fs::path path;
  std::string whole;
  {
    auto recording = Recording::resume(folder.path(), small_plan(), kCamera);
    ASSERT_TRUE(recording);
    for (const Shot& shot : shots) ASSERT_TRUE(recording->add(picture_of(shot)));
    path = recording->path_of(shots[1]);
    whole = read_text(path).value();
  }
  std::string changed = whole;
  changed[whole.size() / 2] = static_cast<char>(changed[whole.size() / 2] ^ 1);
  ASSERT_TRUE(write_text(path, changed));
  auto recording = Recording::open(folder.path());
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->picture(shots[1]).error().code, Errc::kBadFormat);
  EXPECT_TRUE(recording->picture(shots[0]));

  for (const std::size_t length : {std::size_t{0}, whole.size() / 2, whole.size() - 1}) {
    ASSERT_TRUE(write_text(path, whole.substr(0, length)));
    EXPECT_EQ(recording->picture(shots[1]).error().code, Errc::kBadFormat) << length;
    const auto resumed = Recording::resume(folder.path(), small_plan(), kCamera);
    ASSERT_TRUE(resumed);
    EXPECT_FALSE(resumed->has(shots[1])) << length;
    EXPECT_EQ(resumed->shots().size(), shots.size() - 1);
    ASSERT_EQ(resumed->warnings().size(), 1U);
    EXPECT_THAT(resumed->warnings()[0], HasSubstr(path.string()));
  }
  fs::remove(path);
  EXPECT_EQ(recording->picture(shots[1]).error().code, Errc::kNotFound);
  auto resumed = Recording::resume(folder.path(), small_plan(), kCamera);
  ASSERT_TRUE(resumed);
  ASSERT_EQ(resumed->warnings().size(), 1U);
  EXPECT_THAT(resumed->warnings()[0], HasSubstr("gone"));
  ASSERT_TRUE(resumed->add(picture_of(shots[1])));
  EXPECT_TRUE(resumed->picture(shots[1]));
}

TEST(Recording, RefusesOtherConditionsAndNamesThem) {
  const TemporaryFolder folder;
  ASSERT_TRUE(Recording::resume(folder.path(), small_plan(), kCamera));
  CapturePlan other = small_plan();
  other.exposure.frames = 7;
  const auto plan = Recording::resume(folder.path(), other, kCamera);
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, Errc::kInvalidOption);
  EXPECT_THAT(plan.error().what, HasSubstr("plan.exposure.frames is 4, not 7"));
  const auto camera = Recording::resume(folder.path(), small_plan(), "another");
  ASSERT_FALSE(camera);
  EXPECT_EQ(camera.error().code, Errc::kInvalidOption);
  EXPECT_THAT(camera.error().what, HasSubstr("camera"));
  other.exposure.frames = 0;
  EXPECT_EQ(Recording::resume(folder.path(), other, kCamera).error().code, Errc::kInvalidOption);
  EXPECT_TRUE(Recording::resume(folder.path(), small_plan(), kCamera));
}

TEST(Recording, RefusesFoldersOfSomethingElse) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "photos" / "a.jpg", "x"));
  const auto photos = Recording::resume(folder.path() / "photos", small_plan(), kCamera);
  ASSERT_FALSE(photos);
  EXPECT_EQ(photos.error().code, Errc::kInvalidOption);
  EXPECT_THAT(photos.error().what, HasSubstr("a.jpg"));
  EXPECT_FALSE(fs::exists(folder.path() / "photos" / "journal.jsonl"));
  EXPECT_EQ(Recording::open(folder.path() / "photos").error().code, Errc::kNotFound);
  EXPECT_EQ(Recording::open(folder.path() / "nothing").error().code, Errc::kNotFound);

  const fs::path session = folder.path() / "s" / "session.json";
  ASSERT_TRUE(Recording::resume(folder.path() / "s", small_plan(), kCamera));
  const std::string whole = read_text(session).value();
  std::string newer = whole;
  newer.replace(newer.find("\"version\": 1"), 12, "\"version\": 2");
  for (const std::string& text : {newer, std::string("{}"), whole.substr(0, 20), std::string()}) {
    ASSERT_TRUE(write_text(session, text));
    const auto resumed = Recording::resume(folder.path() / "s", small_plan(), kCamera);
    ASSERT_FALSE(resumed) << text;
    EXPECT_EQ(resumed.error().code, Errc::kBadFormat);
    EXPECT_EQ(Recording::open(folder.path() / "s").error().code, Errc::kBadFormat);
    EXPECT_EQ(resumed.error().what.find("newer Veneer") != std::string::npos, text == newer);
  }
}

TEST(Recording, WithoutItsIdentityIsNotGuessed) {
  const TemporaryFolder folder;
  {
    auto recording = Recording::resume(folder.path(), small_plan(), kCamera);
    ASSERT_TRUE(recording);
    ASSERT_TRUE(recording->note("bracket", "1"));
  }
  fs::remove(folder.path() / "session.json");
  EXPECT_EQ(Recording::resume(folder.path(), small_plan(), kCamera).error().code, Errc::kBadFormat);
}

TEST(Recording, IsOpenToOneAtATime) {
  const TemporaryFolder folder;
  const auto first = Recording::resume(folder.path(), small_plan(), kCamera);
  ASSERT_TRUE(first);
  const auto second = Recording::resume(folder.path(), small_plan(), kCamera);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::kUnavailable);
  EXPECT_TRUE(Recording::open(folder.path()));  // who only reads may
}

// Small limits hit the pictures, larger ones the journal.
TEST(Recording, AFullDiskCostsOnlyThePictureThatDidNotFit) {
  for (const rlim_t limit : {rlim_t{1}, rlim_t{300}, rlim_t{900}, rlim_t{2600}}) {
    const TemporaryFolder folder;
    ASSERT_TRUE(Recording::resume(folder.path(), small_plan(), kCamera));
    const int kept = on_full_disk(limit, [&] {
      auto recording = Recording::resume(folder.path(), small_plan(), kCamera);
      if (!recording) return 202;
      for (int added = 0; added < 100; ++added) {
        const Shot shot{Target::kSample, 0, 0, 0, added, false};
        const Status status = recording->add(picture_of(shot));
        if (status) continue;
        const bool right = status.error().code == Errc::kIo && !recording->has(shot) &&
                           !fs::exists(recording->path_of(shot));
        return right ? added : 203;
      }
      return 204;
    });
    ASSERT_GE(kept, 0) << limit;
    ASSERT_LE(kept, 100) << limit;
    EXPECT_EQ(kept > 0, limit >= 900) << limit;
    const auto recording = Recording::resume(folder.path(), small_plan(), kCamera);
    ASSERT_TRUE(recording) << recording.error().what;
    EXPECT_EQ(static_cast<int>(recording->shots().size()), kept) << limit;
    for (const Shot& shot : recording->shots()) EXPECT_TRUE(recording->picture(shot));
  }
}

}  // namespace
}  // namespace veneer::capture
