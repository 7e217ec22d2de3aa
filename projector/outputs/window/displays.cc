// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/window/displays.h"

#include <SDL.h>

#include <cstdlib>
#include <string_view>

#include "projector/outputs/window/internal_sdl.h"

namespace veneer::projector {

void SdlVideo::End::operator()(const void*) const noexcept { SDL_QuitSubSystem(SDL_INIT_VIDEO); }

Result<SdlVideo> SdlVideo::begin() {
  // Without either, SDL would draw into nothing, or take a console's screen.
  if (std::getenv("DISPLAY") == nullptr && std::getenv("WAYLAND_DISPLAY") == nullptr)
    return fail(
        Errc::kUnavailable,
        "looking for displays: there is no desktop here; run this in a session that has one "
        "(DISPLAY or WAYLAND_DISPLAY is set there)");
  // Ctrl-C stays with the program that opens a window.
  SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
  SDL_SetHint(SDL_HINT_VIDEO_ALLOW_SCREENSAVER, "0");
  SDL_SetHint(SDL_HINT_VIDEO_MINIMIZE_ON_FOCUS_LOSS, "0");
  if (SDL_InitSubSystem(SDL_INIT_VIDEO) != 0)
    return fail(
        Errc::kUnavailable,
        "looking for displays: {}; is there a desktop (DISPLAY or WAYLAND_DISPLAY), and may "
        "this user open windows on it?",
        SDL_GetError());
  // X11 takes a window's pixels as they are. On Wayland SDL 2.26 has no way but a texture, for
  // which it takes the thread's GL context.
  const bool takes_pixels = std::string_view(SDL_GetCurrentVideoDriver()) == "x11";
  SDL_SetHint(SDL_HINT_FRAMEBUFFER_ACCELERATION, takes_pixels ? "0" : "1");
  static constexpr char kToken = 0;
  return SdlVideo(&kToken);
}

Result<std::vector<Display>> list_displays() {
  VENEER_ASSIGN(const SdlVideo video, SdlVideo::begin());
  std::vector<Display> displays;
  for (int i = 0; i < SDL_GetNumVideoDisplays(); ++i) {
    SDL_Rect bounds{};
    SDL_DisplayMode mode{};
    if (SDL_GetDisplayBounds(i, &bounds) != 0) continue;
    const char* name = SDL_GetDisplayName(i);
    displays.push_back({i,
                        name == nullptr ? "" : name,
                        bounds.x,
                        bounds.y,
                        bounds.w,
                        bounds.h,
                        SDL_GetCurrentDisplayMode(i, &mode) == 0 ? mode.refresh_rate : 0.0});
  }
  return displays;
}

}  // namespace veneer::projector
