// SPDX-License-Identifier: Apache-2.0
// The whole frame loop in real time: nothing of ours is allocated once it runs.
#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/mman.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <memory>
#include <new>
#include <vector>

#include "base/progress.h"
#include "daemon/daemon.h"
#include "tests/soak/allocation_guard.h"
#include "tests/soak/stage.h"

namespace veneer::soak {
namespace {

using namespace std::chrono_literals;

/// Frames after which everything has been used once: two seconds of figures, a look at the profile.
constexpr std::uint64_t kWarmFrames = 180;
constexpr std::uint64_t kFrames = 420;

/// A display whose memory is mapped, as a frame buffer without a GPU is.
class MappedOutput final : public projector::Output {
 public:
  MappedOutput(int width, int height)
      : bytes_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 4),
        memory_(static_cast<std::uint8_t*>(
            ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0))) {
    VENEER_CHECK(memory_ != MAP_FAILED);
  }
  ~MappedOutput() override { ::munmap(memory_, bytes_); }
  std::string description() const override { return "mapped"; }
  bool wants_pixels(std::uint64_t /*frame_number*/) const override { return true; }
  Status present(const projector::Frame& frame) override {
    std::uint8_t* to = memory_;
    for (int y = 0; y < frame.codes.height(); ++y) {
      for (int x = 0; x < frame.codes.width(); ++x, to += 4) {
        for (std::size_t c = 0; c < 3; ++c)
          to[2 - c] = static_cast<std::uint8_t>(frame.codes(x, y)[c]);
      }
    }
    presented_ = {frame.number, std::chrono::steady_clock::now()};
    return {};
  }
  std::optional<projector::Presented> last_presented() override { return presented_; }
  std::optional<Duration> refresh_period() const override { return Duration(1s) / 60; }

 private:
  std::size_t bytes_;
  std::uint8_t* memory_;
  std::optional<projector::Presented> presented_;
};

/// Nothing: as the null output, but that it may allocate now and then.
class NullOutput final : public projector::Output {
 public:
  explicit NullOutput(bool allocates) : allocates_(allocates) {}
  std::string description() const override { return "null"; }
  bool wants_pixels(std::uint64_t /*frame_number*/) const override { return false; }
  Status present(const projector::Frame& frame) override {
    if (allocates_ && frame.number % 100 == 0)
      waste_ = std::make_unique<std::uint64_t>(frame.number);
    return {};
  }

 private:
  bool allocates_;
  std::unique_ptr<std::uint64_t> waste_;
};

enum class Kind { kNull, kMapped, kAllocating };

struct Counted {
  std::uint64_t ours = 0;
  std::uint64_t of_driver = 0;
  std::string first;
  std::uint64_t watched = 0;  ///< frames
};

Result<Counted> count(Kind kind) {
  Stage::Options options;
  options.virtual_time = false;
  options.frame_rate_hz = 60;
  options.tracker_rate_hz = 240;
  options.frames = kFrames;
  VENEER_ASSIGN(const auto stage, Stage::create(options));
  Counted counted;
  daemon::Devices devices;
  devices.open_output = [&]() -> Result<std::unique_ptr<projector::Output>> {
    if (kind == Kind::kMapped) return std::make_unique<MappedOutput>(options.width, options.height);
    return std::make_unique<NullOutput>(kind == Kind::kAllocating);
  };
  std::uint64_t before_ours = 0;
  std::uint64_t before_driver = 0;
  devices.before_frame = [&](std::uint64_t number, Time /*time*/) {
    if (number == kWarmFrames) {
      AllocationGuard::prepare();
      before_ours = AllocationGuard::ours();
      before_driver = AllocationGuard::of_driver();
      AllocationGuard::arm();
    }
    if (number == kFrames - 1) AllocationGuard::disarm();
    if (number >= kWarmFrames && number < kFrames - 1) ++counted.watched;
  };
  devices.open_control = [](Clock&) -> Result<std::unique_ptr<projector::ProjectorControl>> {
    return fail(Errc::kNotFound, "nobody there");
  };
  VENEER_ASSIGN(const auto daemon, daemon::Daemon::create(stage->config(), {}, std::move(devices)));
  const std::atomic<bool> stop{false};
  SilentProgress silent;
  const auto summary = daemon->run(stop, silent);
  AllocationGuard::disarm();
  if (!summary) return fail_while("running the daemon", summary.error());
  counted.ours = AllocationGuard::ours() - before_ours;
  counted.of_driver = AllocationGuard::of_driver() - before_driver;
  counted.first = AllocationGuard::first();
  return counted;
}

class FrameLoopAllocation : public testing::Test {
 protected:
  void SetUp() override {
    AllocationGuard::prepare();
    AllocationGuard::arm();
    const std::uint64_t before = AllocationGuard::ours();
    ::operator delete(::operator new(1));
    AllocationGuard::disarm();
    if (AllocationGuard::ours() == before)
      GTEST_SKIP() << "a sanitizer has an allocator of its own";
    EXPECT_EQ(AllocationGuard::ours(), before + 1);
  }
  static void expect(Kind kind, bool none) {
    const Result<Counted> counted = count(kind);
    if (!counted && counted.error().code == Errc::kUnavailable)
      GTEST_SKIP() << counted.error().what;
    ASSERT_TRUE(counted) << counted.error().what;
    EXPECT_GE(counted->watched, kFrames - kWarmFrames - 1);
    if (none) {
      EXPECT_EQ(counted->ours, 0U) << "the first is called from\n" << counted->first;
    } else {
      // Frames 200, 300 and 400, and no others.
      EXPECT_EQ(counted->ours, 3U) << counted->first;
    }
  }
};

/// How many allocations the guard sees of what is done, and what it made given back after.
std::uint64_t seen_of(const std::function<void*()>& allocate) {
  const std::uint64_t before = AllocationGuard::ours();
  AllocationGuard::arm();
  void* const memory = allocate();
  AllocationGuard::disarm();
  const std::uint64_t seen = AllocationGuard::ours() - before;
  EXPECT_NE(memory, nullptr);
  std::free(memory);
  return seen;
}

TEST_F(FrameLoopAllocation, IsSeenByEveryWayThereIs) {
  constexpr std::size_t kAlignment = 256;
  EXPECT_EQ(seen_of([] { return std::malloc(8); }), 1U);
  EXPECT_EQ(seen_of([] { return std::calloc(2, 8); }), 1U);
  EXPECT_EQ(seen_of([] { return std::realloc(nullptr, 8); }), 1U);
  EXPECT_EQ(seen_of([] { return std::aligned_alloc(kAlignment, kAlignment); }), 1U);
  EXPECT_EQ(seen_of([] { return ::memalign(kAlignment, 8); }), 1U);
  EXPECT_EQ(seen_of([] {
              void* memory = nullptr;
              EXPECT_EQ(::posix_memalign(&memory, kAlignment, 8), 0);
              return memory;
            }),
            1U);
  // What C++ makes of it, as for anything that is declared alignas(64).
  AllocationGuard::arm();
  const std::uint64_t before = AllocationGuard::ours();
  void* const memory = ::operator new (8, std::align_val_t{kAlignment});
  AllocationGuard::disarm();
  EXPECT_EQ(AllocationGuard::ours(), before + 1);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(memory) % kAlignment, 0U);
  ::operator delete (memory, std::align_val_t{kAlignment});
  void* none = nullptr;
  EXPECT_EQ(::posix_memalign(&none, 24, 8), EINVAL) << "no power of two";
}

TEST_F(FrameLoopAllocation, IsNoneWithTheNullOutput) { expect(Kind::kNull, true); }

TEST_F(FrameLoopAllocation, IsNoneWithAMappedOutput) { expect(Kind::kMapped, true); }

TEST_F(FrameLoopAllocation, IsSeenWhereThereIsOne) { expect(Kind::kAllocating, false); }

}  // namespace
}  // namespace veneer::soak
