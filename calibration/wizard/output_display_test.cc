// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/output_display.h"

#include <gtest/gtest.h>

#include <deque>
#include <vector>

#include "calibration/wizard/aimed_colorimeter.h"

namespace veneer::calibration {
namespace {

/// Remembers what it was asked for; answers as told, else that it was done.
class FakeHands final : public Operator {
 public:
  std::vector<Task> asked;
  std::deque<Answer> answers;
  Result<Answer> please(const Request& request) override {
    asked.push_back(request.task);
    if (answers.empty()) return Answer::kDone;
    const Answer answer = answers.front();
    answers.pop_front();
    return answer;
  }
  Result<Answer> after_failure(std::string_view, const Error&) override { return Answer::kQuit; }
  void say(std::string_view) override {}
};

class FakeOutput final : public projector::Output {
 public:
  std::vector<Rgb16> corners;  // the first pixel of every frame
  std::vector<std::uint64_t> numbers;
  std::string description() const override { return "fake"; }
  bool wants_pixels(std::uint64_t) const override { return true; }
  Status present(const projector::Frame& frame) override {
    corners.push_back(frame.codes(0, 0));
    numbers.push_back(frame.number);
    return {};
  }
};

struct Shown {
  FakeOutput output;
  FakeHands hands;
  VirtualClock clock;
  OutputPatchDisplay display{output, hands, clock, {8, 6, 8, 0.25}};
};

TEST(OutputPatchDisplay, AsksForTheCoverOnceEachTime) {
  Shown shown;
  ASSERT_TRUE(shown.display.show({1, 2, 3}));
  ASSERT_TRUE(shown.display.show({0, 0, 0}, false));
  ASSERT_TRUE(shown.display.show({0, 0, 0}, false));
  ASSERT_TRUE(shown.display.show({9, 9, 9}));
  EXPECT_EQ(shown.hands.asked,
            (std::vector<Task>{Task::kUncoverLens, Task::kCoverLens, Task::kUncoverLens}));
  EXPECT_EQ(shown.output.corners.front(), (Rgb16{1, 2, 3}));
  EXPECT_EQ(shown.output.numbers, (std::vector<std::uint64_t>{0, 1, 2, 3}));
  EXPECT_EQ(shown.clock.now().time_since_epoch(), std::chrono::seconds(1));  // four times settled
}

TEST(OutputPatchDisplay, ALensThatIsNotCoveredIsNoDarkReading) {
  Shown shown;
  shown.hands.answers = {Answer::kSkip};
  const Status status = shown.display.show({0, 0, 0}, false);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kCancelled);
  EXPECT_TRUE(shown.output.corners.empty());
}

TEST(OutputPatchDisplay, RefusesCodesAndSizesThatItDoesNotHave) {
  Shown shown;
  EXPECT_FALSE(shown.display.show({256, 0, 0}));
  const Image<Rgb16> small(7, 6);
  EXPECT_FALSE(shown.display.show_picture(small.view()));
  const Image<Rgb16> right(8, 6, {7, 8, 9});
  ASSERT_TRUE(shown.display.show_picture(right.view()));
  EXPECT_EQ(shown.output.corners, (std::vector<Rgb16>{{7, 8, 9}}));
}

class FakeColorimeter final : public Colorimeter {
 public:
  int readings = 0;
  std::string description() const override { return "fake"; }
  Result<Xyz> read(Target, const Eigen::Vector2d&) override {
    ++readings;
    return Xyz(1, 1, 1);
  }
};

TEST(AimedColorimeter, AsksWheneverAnotherSpotIsWanted) {
  FakeHands hands;
  FakeColorimeter instrument;
  AimedColorimeter aimed(instrument, hands);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(aimed.read(Target::kWhiteReference, {4, 3}));
  ASSERT_TRUE(aimed.read(Target::kWhiteReference, {1, 3}));
  ASSERT_TRUE(aimed.read(Target::kObject, {1, 3}));
  EXPECT_EQ(hands.asked,
            (std::vector<Task>{Task::kAimAtBoard, Task::kAimAtBoard, Task::kAimAtObject}));
  EXPECT_EQ(instrument.readings, 5);
  hands.answers = {Answer::kQuit};
  EXPECT_FALSE(aimed.read(Target::kWhiteReference, {4, 3}));
  EXPECT_EQ(instrument.readings, 5);  // nothing is read of a spot that it does not look at
  ASSERT_TRUE(aimed.read(Target::kWhiteReference, {4, 3}));  // asked again
  EXPECT_EQ(hands.asked.size(), 5U);
}

}  // namespace
}  // namespace veneer::calibration
