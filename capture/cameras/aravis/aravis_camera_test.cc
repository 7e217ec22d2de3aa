// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/aravis/aravis_camera.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <thread>

#include "base/unique_handle.h"

namespace veneer::capture {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

constexpr const char* kProgram = "/usr/bin/arv-fake-gv-camera-0.8";
/// By its address a camera is opened without asking all networks, which takes a second.
const std::string kAddress = "address = \"127.0.0.1\"\n";
/// Long enough for a machine that does ten other things.
constexpr auto kPatience = std::chrono::seconds(60);

/// Aravis' fake camera, a process of its own, on the loopback. It shows a pattern that is constant
/// along the picture's antidiagonals and brighter with gain and exposure.
class FakeCamera {
 public:
  explicit FakeCamera(std::string serial, int lost_per_thousand = 0)
      : serial_(std::move(serial)), lost_(std::to_string(lost_per_thousand)) {
    start();
  }
  FakeCamera(const FakeCamera&) = delete;
  FakeCamera& operator=(const FakeCamera&) = delete;
  ~FakeCamera() { kill(); }

  void start() {
    process_ = ::fork();
    VENEER_CHECK(process_ >= 0);
    if (process_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that crashed
    const int null = ::open("/dev/null", O_WRONLY);
    ::dup2(null, STDOUT_FILENO);
    ::dup2(null, STDERR_FILENO);
    ::execl(kProgram, kProgram, "-i", "lo", "-s", serial_.c_str(), "-r", lost_.c_str(), nullptr);
    ::_exit(127);
  }
  void kill() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
    process_ = 0;
  }
  /// Starts again a camera that gave up, because another one had the port.
  void keep_alive() {
    if (process_ > 0 && ::waitpid(process_, nullptr, WNOHANG) == process_) start();
  }

 private:
  std::string serial_;
  std::string lost_;
  ::pid_t process_ = 0;
};

class AravisCameraTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kProgram)) {
      GTEST_SKIP() << kProgram << " is not installed; install the package aravis-tools";
    }
    // All cameras of a machine share one port: one test at a time, whoever runs it.
    const auto lock = std::filesystem::temp_directory_path() / "veneer-fake-gv-camera.lock";
    lock_ = UniqueFd(::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
    if (lock_) ::flock(lock_.value(), LOCK_EX);
    serial_ = fmt::format("VN{}", ::getpid());
  }

  Result<std::unique_ptr<Camera>> open_once(const std::string& keys) {
    auto toml = TomlReader::parse("driver = \"aravis\"\n" + keys, "rig.toml");
    VENEER_CHECK(toml.has_value());
    VENEER_ASSIGN(auto camera, open_camera(*toml));
    VENEER_TRY(toml->finish());
    return camera;
  }
  [[nodiscard]] std::string by_name() const { return fmt::format("name = \"{}\"\n", serial_); }
  /// Waits until it is there.
  std::unique_ptr<Camera> open(FakeCamera& fake, const std::string& keys = "") {
    std::string why;
    for (const auto end = std::chrono::steady_clock::now() + kPatience;
         std::chrono::steady_clock::now() < end;) {
      fake.keep_alive();
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      auto camera = open_once(kAddress + keys);
      if (camera && (*camera)->description().find(serial_) != std::string::npos) {
        return std::move(*camera);
      }
      why = camera ? "another fake camera is running: " + (*camera)->description()
                   : camera.error().what;
      if (!camera && camera.error().code == Errc::kInvalidOption) break;
    }
    ADD_FAILURE() << why;
    return nullptr;
  }
  /// As a user would: again after a timeout and after a damaged picture.
  static std::optional<CameraFrame> grab(Camera& camera) {
    std::string why;
    for (int attempt = 0; attempt < 10; ++attempt) {
      auto frame = camera.grab();
      if (frame) return std::move(*frame);
      why = frame.error().what;
      if (frame.error().code == Errc::kDisconnected) break;
    }
    ADD_FAILURE() << why;
    return std::nullopt;
  }
  static double brightness(const CameraFrame& frame) {
    double sum = 0;
    for (const Rgb16& pixel : frame.counts.pixels()) sum += pixel[0];
    return sum / static_cast<double>(frame.counts.pixels().size());
  }

  UniqueFd lock_;
  std::string serial_;
};

TEST_F(AravisCameraTest, GivesPicturesThatBeganAfterTheCall) {
  FakeCamera fake(serial_);
  const auto camera = open(fake);
  ASSERT_NE(camera, nullptr);
  EXPECT_THAT(camera->description(), HasSubstr(serial_));
  std::uint64_t last = 0;
  for (int i = 0; i < 5; ++i) {
    const Time before = SteadyClock().now();
    const auto frame = grab(*camera);
    ASSERT_TRUE(frame);
    EXPECT_GE(frame->time, before + from_seconds(0.5 * frame->exposure_s));
    EXPECT_LE(frame->time, SteadyClock().now());
    EXPECT_GT(frame->sequence, last);
    last = frame->sequence;
    ASSERT_EQ(frame->counts.width(), camera->width());
    ASSERT_EQ(frame->counts.height(), camera->height());
    EXPECT_EQ(frame->full_scale, 255);
    EXPECT_EQ(frame->mosaic, Mosaic::kNone);
    for (int y = 0; y + 1 < frame->counts.height(); ++y) {
      for (int x = 0; x + 1 < frame->counts.width(); ++x) {
        ASSERT_EQ(frame->counts(x + 1, y), frame->counts(x, y + 1)) << x << ", " << y;
      }
    }
    EXPECT_GT(brightness(*frame), 1);
  }
}

TEST_F(AravisCameraTest, ExposureIsSetAndReadBackWithinTheCamerasRange) {
  FakeCamera fake(serial_);
  const auto camera = open(fake, "exposure_s = 0.02");
  ASSERT_NE(camera, nullptr);
  const ExposureRange range = camera->exposure_range();
  EXPECT_DOUBLE_EQ(range.least_s, 1e-5);  // as the fake camera's description says
  EXPECT_DOUBLE_EQ(range.most_s, 10);
  EXPECT_DOUBLE_EQ(grab(*camera)->exposure_s, 0.02);
  double dark = 0;
  for (const double seconds : {0.005, 0.1}) {
    ASSERT_TRUE(camera->set_exposure(seconds));
    const auto frame = grab(*camera);
    ASSERT_TRUE(frame);
    EXPECT_DOUBLE_EQ(frame->exposure_s, seconds);
    EXPECT_GT(brightness(*frame), dark);
    dark = brightness(*frame);
  }
  for (const double wrong : {0.0,
                             -1.0,
                             1e-6,
                             11.0,
                             std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()}) {
    const Status status = camera->set_exposure(wrong);
    ASSERT_FALSE(status) << wrong;
    EXPECT_EQ(status.error().code, Errc::kInvalidOption);
    EXPECT_THAT(status.error().what, HasSubstr("1e-05 to 10 s"));
  }
  EXPECT_DOUBLE_EQ(grab(*camera)->exposure_s, 0.1);
}

TEST_F(AravisCameraTest, GainInStepsMakesPicturesBrighterAndDecibelsAreNotMadeUp) {
  FakeCamera fake(serial_);
  double dark = 0;
  for (const int steps : {0, 3}) {
    const auto camera = open(fake, fmt::format("gain_raw = {}\nexposure_s = 0.01", steps));
    ASSERT_NE(camera, nullptr);
    const auto frame = grab(*camera);
    ASSERT_TRUE(frame);
    EXPECT_GT(brightness(*frame), dark);
    dark = brightness(*frame);
    const Status status = camera->set_gain_db(3);
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, Errc::kUnavailable);
    EXPECT_THAT(status.error().what, HasSubstr("gain_raw"));
  }
  const auto beyond = open_once(kAddress + "gain_raw = 11");
  ASSERT_FALSE(beyond);
  EXPECT_THAT(beyond.error().what, HasSubstr("0 to 10"));
}

TEST_F(AravisCameraTest, EveryPixelFormatThatItListsGivesPictures) {
  FakeCamera fake(serial_);
  const auto camera = open(fake, "pixel_format = \"Mono16\"");
  ASSERT_NE(camera, nullptr);
  const std::vector<std::string> formats = camera->pixel_formats();
  ASSERT_FALSE(formats.empty());
  EXPECT_EQ(formats.front(), "Mono16");
  EXPECT_THAT(formats, Contains("BayerRG8"));
  for (const std::string& format : formats) {
    ASSERT_TRUE(camera->set_pixel_format(format)) << format;
    EXPECT_EQ(camera->pixel_formats().front(), format);
    const auto frame = grab(*camera);
    ASSERT_TRUE(frame) << format;
    EXPECT_EQ(frame->full_scale, format == "Mono16" ? 65535 : 255) << format;
    EXPECT_EQ(frame->counts.width(), camera->width());
  }
  const Status status = camera->set_pixel_format("Mono11");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kInvalidOption);
  for (const std::string& format : formats) EXPECT_THAT(status.error().what, HasSubstr(format));
}

TEST_F(AravisCameraTest, ALayoutKeepsEveryPixelAsItIs) {
  FakeCamera fake(serial_);
  const auto grey = open(fake, "layout = \"polarsens-mono\"");
  ASSERT_NE(grey, nullptr);
  EXPECT_EQ(grab(*grey)->mosaic, Mosaic::kPolarMono);
  const Status bayer = grey->set_pixel_format("BayerRG8");
  ASSERT_FALSE(bayer);
  EXPECT_THAT(bayer.error().what, HasSubstr("layout"));
}

TEST_F(AravisCameraTest, AColourLayoutTakesABayerPatternUninterpolated) {
  FakeCamera fake(serial_);
  const auto colour =
      open(fake, "layout = \"polarsens-colour\"\npixel_format = \"BayerRG8\"\nfull_scale = 250");
  ASSERT_NE(colour, nullptr);
  const auto frame = grab(*colour);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->mosaic, Mosaic::kPolarColour);
  EXPECT_EQ(frame->full_scale, 250);
  for (const Rgb16& pixel : frame->counts.pixels()) {
    ASSERT_TRUE(pixel[0] == pixel[1] && pixel[1] == pixel[2]);
  }
  EXPECT_THAT(colour->set_pixel_format("BayerBG8").error().what, HasSubstr("layout"));
}

TEST_F(AravisCameraTest, ASoftwareTriggerTakesAPictureForEachGrab) {
  FakeCamera fake(serial_);
  const auto camera = open(fake, "trigger = \"software\"\ntimeout_s = 5.0");
  ASSERT_NE(camera, nullptr);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(grab(*camera));
  ASSERT_TRUE(camera->set_trigger(Trigger::kFree));
  ASSERT_TRUE(grab(*camera));
}

TEST_F(AravisCameraTest, AHardwareTriggerThatDoesNotComeIsATimeout) {
  FakeCamera fake(serial_);
  const auto camera = open(fake, "trigger = \"hardware\"\ntimeout_s = 0.3");
  ASSERT_NE(camera, nullptr);
  const auto frame = camera->grab();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().code, Errc::kTimeout);
  EXPECT_THAT(frame.error().what, HasSubstr("no signal"));
}

TEST_F(AravisCameraTest, ACameraThatAnotherControlsIsUnavailable) {
  FakeCamera fake(serial_);
  {
    const auto camera = open(fake);
    ASSERT_NE(camera, nullptr);
    const auto second = open_once(kAddress);
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, Errc::kUnavailable);
    EXPECT_THAT(second.error().what, HasSubstr("another program controls it"));
    EXPECT_TRUE(grab(*camera));
  }
  EXPECT_NE(open(fake), nullptr);
}

TEST_F(AravisCameraTest, IsListedUnderTheNameThatOpensIt) {
  FakeCamera fake(serial_);
  ASSERT_NE(open(fake), nullptr);
  const auto list = AravisCamera::list();
  ASSERT_TRUE(list);
  const auto found = std::ranges::find_if(*list, [&](const CameraInfo& each) {
    return each.identity.find(serial_) != std::string::npos;
  });
  ASSERT_NE(found, list->end());
  EXPECT_EQ(found->driver, "aravis");
  const auto camera = open_once(fmt::format("name = \"{}\"", found->identity));
  EXPECT_TRUE(camera) << camera.error().what;
}

TEST_F(AravisCameraTest, ACameraThatIsNotThereIsNotFoundAndTheOthersAreNamed) {
  FakeCamera fake(serial_);
  ASSERT_NE(open(fake), nullptr);
  const auto camera = open_once("name = \"NOBODY\"");
  ASSERT_FALSE(camera);
  EXPECT_EQ(camera.error().code, Errc::kNotFound);
  EXPECT_THAT(camera.error().what, HasSubstr(serial_));
  const auto both = open_once(by_name() + kAddress);
  ASSERT_FALSE(both);
  EXPECT_EQ(both.error().code, Errc::kInvalidOption);
}

TEST_F(AravisCameraTest, AnAddressAtWhichNothingAnswersIsNotFound) {
  for (const std::string address : {"127.0.0.77", "no address"}) {
    const auto camera = open_once(fmt::format("address = \"{}\"", address));
    ASSERT_FALSE(camera);
    EXPECT_EQ(camera.error().code, Errc::kNotFound) << camera.error().what;
    EXPECT_THAT(camera.error().what, HasSubstr(address));
  }
}

TEST_F(AravisCameraTest, LostPacketsAreDamagedPicturesAndGoodOnesComeAfterThem) {
  // Of some 190 packets a picture, so that about half of the pictures are damaged.
  FakeCamera fake(serial_, 4);
  const auto camera = open(fake);
  ASSERT_NE(camera, nullptr);
  int good_after_damaged = 0;
  int damaged = 0;
  for (int i = 0; i < 200 && good_after_damaged == 0; ++i) {
    const auto frame = camera->grab();
    if (frame) {
      good_after_damaged += damaged > 0 ? 1 : 0;
    } else if (frame.error().code == Errc::kBadFormat) {
      ++damaged;
      EXPECT_THAT(frame.error().what, HasSubstr("missing"));
      EXPECT_THAT(frame.error().what, HasSubstr("packet_size"));
    } else {
      ASSERT_EQ(frame.error().code, Errc::kTimeout) << frame.error().what;
    }
  }
  EXPECT_GT(damaged, 0);
  EXPECT_GT(good_after_damaged, 0);
}

TEST_F(AravisCameraTest, ACameraThatIsPulledIsDisconnectedInBoundedTimeAndOpensAgain) {
  FakeCamera fake(serial_);
  {
    const auto camera = open(fake, "timeout_s = 1.0");
    ASSERT_NE(camera, nullptr);
    ASSERT_TRUE(grab(*camera));
    fake.kill();
    const auto begin = std::chrono::steady_clock::now();
    const auto frame = camera->grab();
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.error().code, Errc::kDisconnected) << frame.error().what;
    // Aravis asks six times, half a second apart, and another question may be under way.
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
    EXPECT_EQ(camera->grab().error().code, Errc::kDisconnected);
    EXPECT_EQ(camera->set_exposure(0.01).error().code, Errc::kDisconnected);
  }
  fake.start();
  const auto again = open(fake);
  ASSERT_NE(again, nullptr);
  EXPECT_TRUE(grab(*again));
}

TEST_F(AravisCameraTest, WrongOptionsAreRefusedWithWhatTheyMayBe) {
  for (const std::string wrong :
       {"timeout_s = 0.0", "full_scale = 70000", "packet_size = 100", "layout = \"bayer\""}) {
    const auto camera = open_once(wrong);
    ASSERT_FALSE(camera) << wrong;
    EXPECT_EQ(camera.error().code, Errc::kInvalidOption) << camera.error().what;
    EXPECT_THAT(camera.error().what, HasSubstr(wrong.substr(0, wrong.find(' '))));
  }
}

}  // namespace
}  // namespace veneer::capture
