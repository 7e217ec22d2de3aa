// SPDX-License-Identifier: Apache-2.0
// Against a real X server that draws into a file (Xvfb -fbdir), and a Wayland compositor that draws
// into that.
#include "projector/outputs/window/window_output.h"

#include <SDL.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "base/files.h"
#include "base/random.h"
#include "base/testing/temporary_folder.h"

namespace veneer::projector {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;

/// Xvfb with one screen; absent where it is not installed.
class XServer {
 public:
  XServer() {
    std::array<int, 2> ends{};
    if (::pipe(ends.data()) != 0) return;
    child_ = ::fork();
    if (child_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGTERM);  // never outlives a test that crashed
      ::close(ends[0]);
      const std::string fd = std::to_string(ends[1]);
      const std::string screen = fmt::format("{}x{}x24", kWidth, kHeight);
      ::execlp("Xvfb",
               "Xvfb",
               "-displayfd",
               fd.c_str(),
               "-screen",
               "0",
               screen.c_str(),
               "-fbdir",
               folder_.path().c_str(),
               "-noreset",
               "-nolisten",
               "tcp",
               static_cast<char*>(nullptr));
      ::_exit(127);
    }
    ::close(ends[1]);
    std::string number;
    char c = 0;
    while (::read(ends[0], &c, 1) == 1 && c != '\n') number += c;
    ::close(ends[0]);
    if (number.empty()) return;
    ::setenv("DISPLAY", (":" + number).c_str(), 1);
    ::setenv("SDL_VIDEODRIVER", "x11", 1);
    running_ = true;
  }
  ~XServer() {
    if (child_ > 0) {
      ::kill(child_, SIGTERM);
      ::waitpid(child_, nullptr, 0);
    }
  }
  XServer(const XServer&) = delete;
  XServer& operator=(const XServer&) = delete;

  [[nodiscard]] bool running() const { return running_; }
  /// What is on the screen, from the file in X11's window dump format: a header of big-endian
  /// words, whose first is its own length and whose 19th counts the colours that follow it, then
  /// blue, green, red, unused for each pixel.
  [[nodiscard]] Image<Rgb16> screen() const {
    const Result<std::string> file = read_text(folder_.path() / "Xvfb_screen0");
    if (!file) return {};
    const auto byte = [&file](std::size_t at) { return static_cast<std::uint8_t>((*file)[at]); };
    const auto word = [&byte](std::size_t i) {
      return (std::size_t{byte(4 * i)} << 24U) | (std::size_t{byte(4 * i + 1)} << 16U) |
             (std::size_t{byte(4 * i + 2)} << 8U) | byte(4 * i + 3);
    };
    constexpr std::size_t kColourBytes = 12;
    const std::size_t begin = word(0) + word(19) * kColourBytes;
    const std::size_t row_bytes = word(12);
    Image<Rgb16> image(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const std::size_t at =
            begin + static_cast<std::size_t>(y) * row_bytes + 4 * static_cast<std::size_t>(x);
        image(x, y) = {byte(at + 2), byte(at + 1), byte(at)};
      }
    }
    return image;
  }

 private:
  TemporaryFolder folder_;
  pid_t child_ = -1;
  bool running_ = false;
};

/// Weston, whose only screen is the X server's; absent where it is not installed.
class WaylandCompositor {
 public:
  explicit WaylandCompositor(const XServer& server) {
    if (!server.running()) return;
    ::setenv("XDG_RUNTIME_DIR", folder_.path().c_str(), 1);
    child_ = ::fork();
    if (child_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGTERM);
      const std::string width = fmt::format("--width={}", kWidth);
      const std::string height = fmt::format("--height={}", kHeight);
      const std::string log = fmt::format("--log={}", (folder_.path() / "log").string());
      ::execlp("weston",
               "weston",
               "--backend=x11-backend.so",
               "--use-pixman",
               "--no-config",
               "--idle-time=0",
               "--socket=wayland-test",
               width.c_str(),
               height.c_str(),
               log.c_str(),
               static_cast<char*>(nullptr));
      ::_exit(127);
    }
    constexpr auto kPatience = std::chrono::seconds(30);
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (!std::filesystem::exists(folder_.path() / "wayland-test")) {
      if (int status = 0; ::waitpid(child_, &status, WNOHANG) == child_) {
        child_ = -1;
        installed_ = !(WIFEXITED(status) && WEXITSTATUS(status) == 127);
        return;
      }
      if (std::chrono::steady_clock::now() > deadline) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ::unsetenv("DISPLAY");
    ::setenv("WAYLAND_DISPLAY", "wayland-test", 1);
    ::setenv("SDL_VIDEODRIVER", "wayland", 1);
    running_ = true;
  }
  ~WaylandCompositor() {
    ::unsetenv("WAYLAND_DISPLAY");
    ::unsetenv("XDG_RUNTIME_DIR");
    if (child_ <= 0) return;
    ::kill(child_, SIGTERM);
    ::waitpid(child_, nullptr, 0);
  }
  WaylandCompositor(const WaylandCompositor&) = delete;
  WaylandCompositor& operator=(const WaylandCompositor&) = delete;

  [[nodiscard]] bool installed() const { return installed_; }
  [[nodiscard]] bool running() const { return running_; }
  [[nodiscard]] std::string log() const { return read_text(folder_.path() / "log").value_or(""); }

 private:
  TemporaryFolder folder_;
  pid_t child_ = -1;
  bool installed_ = true;
  bool running_ = false;
};

Image<Rgb16> random_picture(std::uint64_t seed, int width = kWidth, int height = kHeight) {
  Image<Rgb16> picture(width, height);
  Pcg32 random(seed);
  for (Rgb16& pixel : picture.pixels()) {
    for (std::uint16_t& code : pixel) code = static_cast<std::uint16_t>(random.next() % 256);
  }
  return picture;
}

Frame frame_of(const Image<Rgb16>& picture) {
  Frame frame;
  frame.codes = picture.view();
  return frame;
}

/// The pixels that differ between the middle of the screen and a picture, once they do not or time
/// is up: a window appears when the server has got round to it.
int differences(const XServer& server, WindowOutput& output, const Image<Rgb16>& picture) {
  const int left = (kWidth - picture.width()) / 2;
  const int top = (kHeight - picture.height()) / 2;
  int different = -1;
  for (int attempt = 0; attempt < 100 && different != 0; ++attempt) {
    if (const Status shown = output.present(frame_of(picture)); !shown) {
      ADD_FAILURE() << shown.error().what;
      return -1;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const Image<Rgb16> screen = server.screen();
    different = 0;
    for (int y = 0; y < picture.height(); ++y) {
      for (int x = 0; x < picture.width(); ++x)
        different += screen(left + x, top + y) == picture(x, y) ? 0 : 1;
    }
  }
  return different;
}

class WindowOutputTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!server_.running()) GTEST_SKIP() << "there is no Xvfb on this machine";
  }
  XServer server_;
};

TEST_F(WindowOutputTest, EveryCodeReachesTheScreenUnchanged) {
  auto output = WindowOutput::open(WindowOutputOptions{});
  ASSERT_TRUE(output) << output.error().what;
  EXPECT_TRUE((*output)->wants_pixels(0));
  for (const std::uint64_t seed : {1U, 2U, 3U})
    EXPECT_EQ(differences(server_, **output, random_picture(seed)), 0) << seed;
}

TEST_F(WindowOutputTest, NamesTheDisplaysThatThereAre) {
  const auto displays = list_displays();
  ASSERT_TRUE(displays) << displays.error().what;
  ASSERT_EQ(displays->size(), 1U);
  EXPECT_EQ(displays->front().width, kWidth);
  EXPECT_EQ(displays->front().height, kHeight);
  const auto output = WindowOutput::open(WindowOutputOptions{.display = 5});
  ASSERT_FALSE(output);
  EXPECT_EQ(output.error().code, Errc::kUnavailable);
  EXPECT_NE(output.error().what.find(fmt::format("{} x {}", kWidth, kHeight)), std::string::npos)
      << output.error().what;
}

TEST_F(WindowOutputTest, RefusesWhatItWouldHaveToChange) {
  auto output = WindowOutput::open(WindowOutputOptions{});
  ASSERT_TRUE(output) << output.error().what;
  const Image<Rgb16> small(16, 16);
  EXPECT_FALSE((*output)->present(frame_of(small)));
  const Image<Rgb16> picture = random_picture(1);
  Frame deep = frame_of(picture);
  deep.bits = 10;
  const Status shown = (*output)->present(deep);
  ASSERT_FALSE(shown);
  EXPECT_NE(shown.error().what.find("8 bits"), std::string::npos) << shown.error().what;
}

TEST_F(WindowOutputTest, NotFullScreenItIsAWindowOfThePicturesSize) {
  auto output = WindowOutput::open(WindowOutputOptions{.fullscreen = false});
  ASSERT_TRUE(output) << output.error().what;
  const Image<Rgb16> picture = random_picture(1, 100, 80);
  EXPECT_EQ(differences(server_, **output, picture), 0);
  // And no more than that is covered.
  const Image<Rgb16> screen = server_.screen();
  EXPECT_EQ(screen(0, 0), Rgb16{});
  EXPECT_EQ(screen(kWidth - 1, kHeight - 1), Rgb16{});
}

TEST_F(WindowOutputTest, ClosedOrEscapedItIsCancelled) {
  SDL_Event quit{};
  quit.type = SDL_QUIT;
  SDL_Event escape{};
  escape.type = SDL_KEYDOWN;
  escape.key.keysym.sym = SDLK_ESCAPE;
  SDL_Event close{};
  close.type = SDL_WINDOWEVENT;
  close.window.event = SDL_WINDOWEVENT_CLOSE;
  SDL_Event other = escape;
  other.key.keysym.sym = SDLK_SPACE;
  const Image<Rgb16> picture = random_picture(1);
  for (SDL_Event event : {quit, escape, close, other}) {
    auto output = WindowOutput::open(WindowOutputOptions{});
    ASSERT_TRUE(output) << output.error().what;
    ASSERT_TRUE((*output)->present(frame_of(picture)));
    ASSERT_EQ(SDL_PushEvent(&event), 1) << SDL_GetError();
    const Status shown = (*output)->present(frame_of(picture));
    if (event.type == SDL_KEYDOWN && event.key.keysym.sym == SDLK_SPACE) {
      EXPECT_TRUE(shown) << shown.error().what;
      continue;
    }
    ASSERT_FALSE(shown) << event.type;
    EXPECT_EQ(shown.error().code, Errc::kCancelled) << shown.error().what;
  }
}

// Where there is no X server at all, only a texture takes pixels to the screen.
TEST(WindowOutputOnWayland, EveryCodeReachesTheScreenUnchanged) {
  const XServer server;
  const WaylandCompositor compositor(server);
  if (!server.running() || !compositor.installed())
    GTEST_SKIP() << "there is no Xvfb or no weston on this machine";
  ASSERT_TRUE(compositor.running()) << compositor.log();
  auto output = WindowOutput::open(WindowOutputOptions{});
  ASSERT_TRUE(output) << output.error().what;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    EXPECT_EQ(differences(server, **output, random_picture(seed)), 0) << seed;
    // The thread's context is the renderer's again.
    EXPECT_EQ(SDL_GL_GetCurrentContext(), nullptr);
  }
}

TEST(WindowOutputWithoutADesktop, SaysWhatIsMissing) {
  ::unsetenv("WAYLAND_DISPLAY");
  ::unsetenv("DISPLAY");
  const auto none = list_displays();
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kUnavailable);
  ::setenv("SDL_VIDEODRIVER", "x11", 1);
  ::setenv("DISPLAY", ":9877", 1);  // nobody listens there
  const auto output = WindowOutput::open(WindowOutputOptions{});
  ASSERT_FALSE(output);
  EXPECT_EQ(output.error().code, Errc::kUnavailable);
  EXPECT_NE(output.error().what.find("DISPLAY"), std::string::npos) << output.error().what;
}

}  // namespace
}  // namespace veneer::projector
