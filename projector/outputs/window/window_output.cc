// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/window/window_output.h"

#include <SDL.h>

#include <algorithm>
#include <utility>

#include "projector/outputs/window/internal_sdl.h"

namespace veneer::projector {
namespace {

struct CloseWindow {
  void operator()(SDL_Window* window) const noexcept { SDL_DestroyWindow(window); }
};
using WindowHandle = std::unique_ptr<SDL_Window, CloseWindow>;

/// Where SDL draws with a GL context of its own, it believes that it is current for good. It is let
/// go of, so that SDL takes it again, and the renderer of this thread its own.
class LetGoOfGl {
 public:
  explicit LetGoOfGl(SDL_Window* window) : window_(window) {}
  ~LetGoOfGl() {
    if (SDL_GL_GetCurrentContext() != nullptr) SDL_GL_MakeCurrent(window_, nullptr);
  }
  LetGoOfGl(const LetGoOfGl&) = delete;
  LetGoOfGl& operator=(const LetGoOfGl&) = delete;

 private:
  SDL_Window* window_;
};

std::string text_of(const std::vector<Display>& displays) {
  std::string text;
  for (const Display& d : displays)
    text += fmt::format(
        "\n  {}: {} ({} x {} at {}, {})", d.number, d.name, d.width, d.height, d.x, d.y);
  return text;
}

}  // namespace

struct WindowOutput::State {
  SdlVideo video;
  Display display;
  bool fullscreen;
  WindowHandle window;  // made with the first frame, whose size it has
};

Status WindowOutputOptions::check() const {
  if (display < 0)
    return fail(Errc::kInvalidOption, "opening the window output: display is {}", display);
  return {};
}

Result<std::unique_ptr<WindowOutput>> WindowOutput::open(TomlReader& config) {
  WindowOutputOptions options;
  config.read("display", options.display);
  config.read("fullscreen", options.fullscreen);
  return open(options);
}

Result<std::unique_ptr<WindowOutput>> WindowOutput::open(const WindowOutputOptions& options) {
  VENEER_TRY(options.check());
  VENEER_ASSIGN(SdlVideo video, SdlVideo::begin());
  VENEER_ASSIGN(const std::vector<Display> displays, list_displays());
  const auto found = std::ranges::find(displays, options.display, &Display::number);
  if (found == displays.end())
    return fail(Errc::kUnavailable,
                "opening the window output: there is no display {}; there are:{}",
                options.display,
                text_of(displays));
  return std::unique_ptr<WindowOutput>(new WindowOutput(
      std::unique_ptr<State>(new State{std::move(video), *found, options.fullscreen, {}})));
}

WindowOutput::WindowOutput(std::unique_ptr<State> state) : state_(std::move(state)) {}
WindowOutput::~WindowOutput() = default;

const Display& WindowOutput::display() const { return state_->display; }

std::string WindowOutput::description() const {
  const Display& d = state_->display;
  return fmt::format("window on display {} ({}, {} x {})", d.number, d.name, d.width, d.height);
}

Status WindowOutput::present(const Frame& frame) {
  const auto doing = [this] { return "showing a frame in the " + description(); };
  const Display& d = state_->display;
  const int width = frame.codes.width();
  const int height = frame.codes.height();
  if (frame.bits > 8)
    return fail(Errc::kInvalidOption,
                "{}: the codes have {} bits, a window has 8; use a profile of 8 bits",
                doing(),
                frame.bits);
  if (state_->fullscreen && (width != d.width || height != d.height))
    return fail(Errc::kInvalidOption,
                "{}: the picture has {} x {} pixels; set the display to that mode",
                doing(),
                width,
                height);
  if (!state_->window) {
    const Uint32 flags = SDL_WINDOW_SHOWN |
                         (state_->fullscreen ? SDL_WINDOW_FULLSCREEN_DESKTOP |
                                                   SDL_WINDOW_BORDERLESS | SDL_WINDOW_ALWAYS_ON_TOP
                                             : 0U);
    state_->window.reset(SDL_CreateWindow("Veneer",
                                          SDL_WINDOWPOS_CENTERED_DISPLAY(d.number),
                                          SDL_WINDOWPOS_CENTERED_DISPLAY(d.number),
                                          width,
                                          height,
                                          flags));
    if (!state_->window) return fail(Errc::kUnavailable, "{}: {}", doing(), SDL_GetError());
    if (state_->fullscreen) SDL_ShowCursor(SDL_DISABLE);
  }
  SDL_Event event;
  while (SDL_PollEvent(&event) != 0) {
    if (event.type == SDL_QUIT ||
        (event.type == SDL_KEYDOWN && event.key.keysym.sym == SDLK_ESCAPE) ||
        (event.type == SDL_WINDOWEVENT && event.window.event == SDL_WINDOWEVENT_CLOSE))
      return fail(Errc::kCancelled, "{}: the window was closed", doing());
  }
  const LetGoOfGl let_go(state_->window.get());
  // After a change of the window it is another surface, so it is asked for each time.
  SDL_Surface* surface = SDL_GetWindowSurface(state_->window.get());
  if (surface == nullptr) return fail(Errc::kIo, "{}: {}", doing(), SDL_GetError());
  if (surface->format->BytesPerPixel != 4 || surface->w < width || surface->h < height)
    return fail(Errc::kIo,
                "{}: the window has {} x {} pixels of {} bytes; {} x {} of 4 are needed",
                doing(),
                surface->w,
                surface->h,
                surface->format->BytesPerPixel,
                width,
                height);
  if (SDL_LockSurface(surface) != 0) return fail(Errc::kIo, "{}: {}", doing(), SDL_GetError());
  for (int y = 0; y < height; ++y) {
    auto* row = reinterpret_cast<Uint32*>(static_cast<Uint8*>(surface->pixels) +
                                          static_cast<std::ptrdiff_t>(y) * surface->pitch);
    const auto codes = frame.codes.row(y);
    for (int x = 0; x < width; ++x) {
      const Rgb16& code = codes[static_cast<std::size_t>(x)];
      row[x] = SDL_MapRGB(surface->format,
                          static_cast<Uint8>(code[0]),
                          static_cast<Uint8>(code[1]),
                          static_cast<Uint8>(code[2]));
    }
  }
  SDL_UnlockSurface(surface);
  if (SDL_UpdateWindowSurface(state_->window.get()) != 0)
    return fail(Errc::kIo, "{}: {}", doing(), SDL_GetError());
  return {};
}

}  // namespace veneer::projector
