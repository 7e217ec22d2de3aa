// SPDX-License-Identifier: Apache-2.0
#include "service/bus/command_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <algorithm>

#include "service/testing/fake_control.h"

namespace veneer::service {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr auto kPatience = 20s;

class CommandQueueTest : public testing::Test {
 protected:
  ~CommandQueueTest() override {
    control_.hold(false);
    control_.hold_blanks(false);
  }
  /// Waits until so many were done in all; their numbers in the order in which they were.
  std::vector<std::uint64_t> done(std::size_t count) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (done_.size() < count && std::chrono::steady_clock::now() < end) {
      pollfd readable{queue_.done_fd(), POLLIN, 0};
      ::poll(&readable, 1, 100);
      for (const CommandQueue::Done& each : queue_.take_done()) {
        done_.push_back(each.id);
        refused_ += each.result ? 0 : 1;
      }
    }
    return done_;
  }
  void wait_for_told(std::size_t count) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (control_.told().size() < count && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(1ms);
    ASSERT_THAT(control_.told(), SizeIs(count));
  }

  FakeControl control_;
  CommandQueue queue_{control_};
  std::vector<std::uint64_t> done_;
  int refused_ = 0;
};

TEST_F(CommandQueueTest, DoesOneAfterTheOther) {
  for (std::uint64_t id = 1; id <= 4; ++id)
    ASSERT_TRUE(queue_.submit(id, id % 2 == 1 ? Command(Reload{}) : Command(Snapshot{})));
  EXPECT_THAT(done(4), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(control_.told(), ElementsAre("reload", "snapshot", "reload", "snapshot"));
}

TEST_F(CommandQueueTest, BlankPassesAllThatWaitAndIsNeverOneTooMany) {
  control_.hold(true);
  ASSERT_TRUE(queue_.submit(1, Reload{}));
  wait_for_told(1);
  std::uint64_t id = 2;
  while (queue_.submit(id, Reload{})) ASSERT_LT(++id, 100U);
  EXPECT_TRUE(queue_.submit(100, Blank{true}));
  EXPECT_THAT(done(1), ElementsAre(100));
  EXPECT_EQ(control_.status().state, State::kBlank);
  EXPECT_TRUE(queue_.submit(101, Blank{false}));
  EXPECT_THAT(done(2), ElementsAre(100, 101));
  EXPECT_EQ(control_.status().state, State::kRunning);
  control_.hold(false);
  EXPECT_THAT(done(id + 1), SizeIs(id + 1));
  EXPECT_EQ(refused_, 0);
}

TEST_F(CommandQueueTest, OfManyBlanksThatWaitTheLastIsDoneAndAllAreAnswered) {
  control_.hold_blanks(true);
  ASSERT_TRUE(queue_.submit(1, Blank{true}));
  wait_for_told(1);
  for (std::uint64_t id = 2; id <= 200; ++id) ASSERT_TRUE(queue_.submit(id, Blank{id % 2 == 1}));
  control_.hold_blanks(false);
  const std::vector<std::uint64_t> answered = done(200);
  ASSERT_THAT(answered, SizeIs(200));
  EXPECT_TRUE(std::ranges::is_sorted(answered));
  EXPECT_THAT(control_.told(), ElementsAre("blank", "unblank")) << "200 is even";
}

TEST_F(CommandQueueTest, RefusesWhatIsNoCommand) {
  EXPECT_EQ(queue_.submit(1, SetScene{"relative"}).error().code, Errc::kInvalidOption);
  EXPECT_THAT(control_.told(), IsEmpty());
}

}  // namespace
}  // namespace veneer::service
