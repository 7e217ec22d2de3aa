// SPDX-License-Identifier: Apache-2.0
#include "render/egl_context.h"

#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

namespace veneer::render {
namespace {

constexpr std::string_view kHowToGetOne =
    "a software one comes with `apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri`, a GPU's "
    "with "
    "its driver";

bool lists(const char* extensions, std::string_view name) {
  if (extensions == nullptr) return false;
  std::string_view rest(extensions);
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    if (rest.substr(0, end) == name) return true;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return false;
}

std::string last_egl_error() { return fmt::format("EGL error {:#06x}", eglGetError()); }

// A hold on an initialised display. EGL has one per platform and process, however often it is asked
// for, so that contexts share it and the last one terminates it: under the lock, or a display that
// another thread has just been given would end under it.
class Display {
 public:
  static Result<Display> open(EGLDisplay handle) {
    Shared& shared = Display::shared();
    const std::scoped_lock lock(shared.mutex);
    EGLint major = 0;
    EGLint minor = 0;
    if (shared.holds[handle] == 0 && eglInitialize(handle, &major, &minor) != EGL_TRUE)
      return fail(Errc::kUnavailable, "cannot be initialised ({})", last_egl_error());
    ++shared.holds[handle];
    return Display(handle);
  }
  Display(Display&& other) noexcept
      : handle_(std::exchange(other.handle_, static_cast<EGLDisplay>(EGL_NO_DISPLAY))) {}
  Display& operator=(Display&&) = delete;
  ~Display() {
    if (handle_ == EGL_NO_DISPLAY) return;
    Shared& shared = Display::shared();
    const std::scoped_lock lock(shared.mutex);
    if (--shared.holds[handle_] == 0) eglTerminate(handle_);
  }
  [[nodiscard]] EGLDisplay handle() const { return handle_; }

 private:
  struct Shared {
    std::mutex mutex;
    std::map<EGLDisplay, int> holds;
  };
  static Shared& shared() {
    static Shared the_one;
    return the_one;
  }
  explicit Display(EGLDisplay handle) : handle_(handle) {}
  EGLDisplay handle_;
};

struct Platform {
  std::string name;
  EGLenum kind;
  void* native;
};

// What may give a context, best first.
std::vector<Platform> platforms() {
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  std::vector<Platform> hardware;
  std::vector<Platform> software;
  const bool can_list =
      lists(client, "EGL_EXT_device_base") || lists(client, "EGL_EXT_device_enumeration");
  if (can_list && lists(client, "EGL_EXT_platform_device")) {
    std::array<EGLDeviceEXT, 32> devices{};
    EGLint count = 0;
    if (eglQueryDevicesEXT(static_cast<EGLint>(devices.size()), devices.data(), &count) ==
        EGL_TRUE) {
      for (int i = 0; i < count; ++i) {
        const char* extensions = eglQueryDeviceStringEXT(devices[i], EGL_EXTENSIONS);
        auto& list = lists(extensions, "EGL_MESA_device_software") ? software : hardware;
        list.push_back({fmt::format("device {}", i), EGL_PLATFORM_DEVICE_EXT, devices[i]});
      }
    }
  }
  std::vector<Platform> all = std::move(hardware);
  if (lists(client, "EGL_MESA_platform_surfaceless"))
    all.push_back({"surfaceless", EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY});
  all.insert(all.end(), software.begin(), software.end());
  if (const char* wanted = std::getenv("VENEER_EGL"))
    std::erase_if(all, [&](const Platform& p) { return p.name.find(wanted) == std::string::npos; });
  return all;
}

bool debugging() {
#ifdef NDEBUG
  return std::getenv("VENEER_GL_DEBUG") != nullptr;
#else
  return true;
#endif
}

void APIENTRY report_gl_message(GLenum /*source*/,
                                GLenum type,
                                GLuint id,
                                GLenum /*severity*/,
                                GLsizei length,
                                const GLchar* text,
                                const void* /*user*/) {
  if (type != GL_DEBUG_TYPE_ERROR) return;
  spdlog::error(
      "OpenGL error {:#x}: {}", id, std::string_view(text, static_cast<std::size_t>(length)));
}

}  // namespace

struct EglContext::State {
  explicit State(Display the_display) : display(std::move(the_display)) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    if (context == EGL_NO_CONTEXT) return;
    if (eglGetCurrentContext() == context)
      eglMakeCurrent(display.handle(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display.handle(), context);
  }

  Display display;
  EGLContext context = EGL_NO_CONTEXT;
  bool reports_resets = false;
  bool lost = false;
  std::string description;

  static Result<std::unique_ptr<State>> create(const Platform& platform) {
    const EGLDisplay handle = eglGetPlatformDisplayEXT(platform.kind, platform.native, nullptr);
    if (handle == EGL_NO_DISPLAY)
      return fail(Errc::kUnavailable, "has no display ({})", last_egl_error());
    VENEER_ASSIGN(Display display, Display::open(handle));
    const char* extensions = eglQueryString(handle, EGL_EXTENSIONS);
    for (const char* needed : {"EGL_KHR_surfaceless_context", "EGL_KHR_create_context"}) {
      if (!lists(extensions, needed)) return fail(Errc::kUnavailable, "lacks {}", needed);
    }
    if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE)
      return fail(Errc::kUnavailable, "has no desktop OpenGL ({})", last_egl_error());

    // Nothing is drawn to a surface, so that any configuration will do, or none.
    EGLConfig config = EGL_NO_CONFIG_KHR;
    if (!lists(extensions, "EGL_KHR_no_config_context")) {
      const std::array<EGLint, 5> wanted{
          EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
      EGLint count = 0;
      if (eglChooseConfig(handle, wanted.data(), &config, 1, &count) != EGL_TRUE || count == 0)
        return fail(Errc::kUnavailable, "has no configuration for OpenGL");
    }
    auto state = std::make_unique<State>(std::move(display));
    // A driver that cannot tell of resets refuses the first.
    for (const bool robust : {true, false}) {
      const std::array<EGLint, 11> attributes{
          EGL_CONTEXT_MAJOR_VERSION_KHR,
          4,
          EGL_CONTEXT_MINOR_VERSION_KHR,
          5,
          EGL_CONTEXT_OPENGL_PROFILE_MASK_KHR,
          EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT_KHR,
          EGL_CONTEXT_FLAGS_KHR,
          debugging() ? EGL_CONTEXT_OPENGL_DEBUG_BIT_KHR : 0,
          robust ? EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY_KHR : EGL_NONE,
          EGL_LOSE_CONTEXT_ON_RESET_KHR,
          EGL_NONE};
      state->context = eglCreateContext(handle, config, EGL_NO_CONTEXT, attributes.data());
      if (state->context != EGL_NO_CONTEXT) break;
    }
    if (state->context == EGL_NO_CONTEXT)
      return fail(Errc::kUnavailable, "gives no OpenGL 4.5 core context ({})", last_egl_error());
    if (eglMakeCurrent(handle, EGL_NO_SURFACE, EGL_NO_SURFACE, state->context) != EGL_TRUE)
      return fail(Errc::kUnavailable, "cannot be used without a surface ({})", last_egl_error());
    // Some drivers take the wish and do not fulfil it; what counts is what the context says.
    GLint strategy = GL_NO_RESET_NOTIFICATION;
    glGetIntegerv(GL_RESET_NOTIFICATION_STRATEGY, &strategy);
    state->reports_resets = strategy == GL_LOSE_CONTEXT_ON_RESET;
    state->description =
        fmt::format("{}, {}, through {}{}",
                    reinterpret_cast<const char*>(glGetString(GL_RENDERER)),
                    reinterpret_cast<const char*>(glGetString(GL_VERSION)),
                    platform.name,
                    state->reports_resets ? "" : ", which does not tell of resets");
    if (debugging()) {
      glEnable(GL_DEBUG_OUTPUT);
      glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
      glDebugMessageCallback(&report_gl_message, nullptr);
    }
    return state;
  }
};

EglContext::EglContext(std::unique_ptr<State> state) : state_(std::move(state)) {}
EglContext::EglContext(EglContext&&) noexcept = default;
EglContext::~EglContext() = default;

Status EglContext::find_library() {
  // libepoxy ends the program where it cannot load the library, so look first. It is never closed:
  // drivers do not survive being unloaded.
  static void* const library = dlopen("libEGL.so.1", RTLD_LAZY | RTLD_LOCAL);
  if (library == nullptr)
    return fail(
        Errc::kUnavailable, "making an OpenGL context: there is no libEGL.so.1; {}", kHowToGetOne);
  return {};
}

Result<EglContext> EglContext::create() {
  VENEER_TRY(find_library());
  std::string tried;
  for (const Platform& platform : platforms()) {
    auto state = State::create(platform);
    if (state) return EglContext(std::move(*state));
    tried += fmt::format("{}{} {}", tried.empty() ? "" : "; ", platform.name, state.error().what);
  }
  if (tried.empty()) {
    const char* wanted = std::getenv("VENEER_EGL");
    tried = fmt::format("EGL offers no platform without a display{}{}",
                        wanted != nullptr ? " named as in VENEER_EGL=" : "",
                        wanted != nullptr ? wanted : "");
  }
  return fail(Errc::kUnavailable, "making an OpenGL 4.5 context: {}; {}", tried, kHowToGetOne);
}

Result<EglContext> EglContext::create_on(void* gbm_device) {
  VENEER_TRY(find_library());
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (!lists(client, "EGL_KHR_platform_gbm") && !lists(client, "EGL_MESA_platform_gbm"))
    return fail(Errc::kUnavailable,
                "making an OpenGL context on the display's device: EGL has no GBM platform; {}",
                kHowToGetOne);
  auto state = State::create({"GBM", EGL_PLATFORM_GBM_KHR, gbm_device});
  if (!state)
    return fail(Errc::kUnavailable,
                "making an OpenGL 4.5 context on the display's device: GBM {}; {}",
                state.error().what,
                kHowToGetOne);
  return EglContext(std::move(*state));
}

void EglContext::make_current() const {
  if (eglGetCurrentContext() == state_->context || state_->lost) return;
  eglBindAPI(EGL_OPENGL_API);  // each thread has its own, and OpenGL ES at first
  const EGLBoolean done =
      eglMakeCurrent(state_->display.handle(), EGL_NO_SURFACE, EGL_NO_SURFACE, state_->context);
  if (done == EGL_TRUE) return;
  state_->lost = eglGetError() == EGL_CONTEXT_LOST;
  VENEER_CHECK(state_->lost);  // or another thread still has it
  // Nothing may go to a context that happened to be current.
  eglMakeCurrent(state_->display.handle(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

void EglContext::release() const {
  if (eglGetCurrentContext() != state_->context) return;
  eglMakeCurrent(state_->display.handle(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

bool EglContext::lost() const {
  if (state_->lost) return true;
  make_current();
  if (!state_->lost && state_->reports_resets)
    state_->lost = glGetGraphicsResetStatus() != GL_NO_ERROR;
  return state_->lost;
}

void* EglContext::display() const { return state_->display.handle(); }

const std::string& EglContext::description() const { return state_->description; }

bool EglContext::is_software() const {
  return description().starts_with("llvmpipe") || description().starts_with("softpipe");
}

}  // namespace veneer::render
