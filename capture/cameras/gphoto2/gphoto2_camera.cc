// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/gphoto2/gphoto2_camera.h"

#include <fmt/format.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "base/image_files.h"
#include "capture/cameras/gphoto2/internal_link.h"
#include "capture/cameras/gphoto2/raw_picture.h"
#include "capture/cameras/gphoto2/shutter_speed.h"

namespace veneer::capture {
namespace {

/// The connection once it is there. Shared with the thread that calls the library, which outlives
/// the camera object where a camera hangs.
using SharedLink = std::shared_ptr<std::unique_ptr<GphotoLink>>;

/// Runs `work` on a thread of its own and waits for it as long as `limit`: the library waits for
/// some answers without end, and nothing can wake it. Errors: those of `work`; kDisconnected, and
/// `link` is empty then, where the camera hangs.
template <class T>
Result<T> within(Duration limit,
                 const std::string& doing,
                 SharedLink& link,
                 std::function<Result<T>(std::unique_ptr<GphotoLink>&)> work) {
  struct Call {
    std::mutex mutex;
    std::condition_variable done;
    std::optional<Result<T>> result;
  };
  // Shared: whichever of both threads comes last frees it.
  auto call = std::make_shared<Call>();
  std::thread worker([call, held = link, work = std::move(work)]() mutable {
    // The library writes to sockets as if nobody ever closed one: that signal would end the
    // program. It is the writing thread's own, and dies with it.
    sigset_t broken_pipe;
    ::sigemptyset(&broken_pipe);
    ::sigaddset(&broken_pipe, SIGPIPE);
    ::pthread_sigmask(SIG_BLOCK, &broken_pipe, nullptr);
    Result<T> result = work(*held);
    held.reset();
    const std::lock_guard lock(call->mutex);
    call->result = std::move(result);
    call->done.notify_all();
  });
  std::unique_lock lock(call->mutex);
  if (!call->done.wait_for(lock, limit, [&] { return call->result.has_value(); })) {
    worker.detach();
    link.reset();
    return fail(Errc::kDisconnected,
                "{}: the camera has not answered for {:.3g} s and hangs; switch it off and on, "
                "take the battery out if it ignores that, and open it again",
                doing,
                to_seconds(limit));
  }
  lock.unlock();
  worker.join();
  return std::move(*call->result);
}

/// Closing asks the camera too.
void close(SharedLink& link, Duration limit) {
  if (!link) return;
  (void)within<void>(
      limit, "closing the camera", link, [](std::unique_ptr<GphotoLink>& open) -> Status {
        open.reset();
        return {};
      });
  link.reset();
}

struct Settings {
  GphotoAddress address;
  std::optional<int> iso;
  std::string white_balance;
  std::string image_format;
  bool allow_encoded = false;
  Duration answer = std::chrono::seconds(30);
};

/// The shutter speeds and what goes with them, all that is known once a camera is open.
struct Opened {
  CameraChoice shutter;
  std::string serial;
};

Status set_named(GphotoLink& link,
                 const std::vector<std::string>& names,
                 const std::string& value) {
  VENEER_ASSIGN(const CameraChoice choice, link.choice(names));
  return link.set(choice, value);
}

Result<Opened> prepare(GphotoLink& link, const Settings& settings) {
  // Pictures go to the camera's memory where it can do that: its first choice.
  if (auto target = link.choice({"capturetarget"}); target && !target->values.empty()) {
    VENEER_TRY(link.set(*target, target->values.front()));
  }
  if (!settings.image_format.empty()) {
    VENEER_TRY(set_named(link, {"imageformat", "imagequality"}, settings.image_format));
  }
  if (!settings.white_balance.empty()) {
    VENEER_TRY(set_named(link, {"whitebalance"}, settings.white_balance));
  }
  if (settings.iso) {
    VENEER_TRY(set_named(link, {"iso"}, std::to_string(*settings.iso)));
  } else if (auto iso = link.choice({"iso"}); iso && !shutter_seconds(iso->now)) {
    // Whatever is no plain number is an automatic.
    return fail(Errc::kInvalidOption,
                "the camera chooses its sensitivity itself (ISO \"{}\"), so that pictures cannot "
                "be compared: set the key iso, 100 for example",
                iso->now);
  }
  VENEER_ASSIGN(CameraChoice shutter, link.choice({"shutterspeed", "shutterspeed2", "exptime"}));
  return Opened{std::move(shutter), link.serial()};
}

class Gphoto2Camera final : public Camera {
 public:
  Gphoto2Camera(Settings settings, SharedLink link, Opened opened)
      : settings_(std::move(settings)),
        link_(std::move(link)),
        shutter_(std::move(opened.shutter)),
        serial_(std::move(opened.serial)),
        speeds_(shutter_speeds(shutter_.values)) {}

  ~Gphoto2Camera() override { close(link_, settings_.answer); }

  [[nodiscard]] std::string description() const override {
    return fmt::format("gphoto2, {} at {}{}{}",
                       settings_.address.model,
                       settings_.address.port,
                       serial_.empty() ? "" : ", serial number ",
                       serial_);
  }
  [[nodiscard]] int width() const override { return width_; }
  [[nodiscard]] int height() const override { return height_; }
  [[nodiscard]] ExposureRange exposure_range() const override {
    if (speeds_.empty()) return {};
    return {speeds_.front().seconds, speeds_.back().seconds};
  }

  [[nodiscard]] Status set_exposure(double seconds) override {
    VENEER_ASSIGN(ShutterSpeed speed, nearest_speed(speeds_, seconds));
    VENEER_TRY(call<void>(settings_.answer,
                          "setting the exposure",
                          [shutter = shutter_, name = speed.name](GphotoLink& link) {
                            return link.set(shutter, name);
                          }));
    exposure_s_ = speed.seconds;
    return {};
  }

  [[nodiscard]] Result<CameraFrame> grab() override {
    // A JPEG may be all that is to come: then every picture pays for this wait.
    const Duration wait_for_raw = std::chrono::milliseconds(settings_.allow_encoded ? 300 : 3000);
    // The library's own waits end first, where it keeps to them.
    const Duration patience = settings_.answer / 2 + from_seconds(exposure_s_);
    VENEER_ASSIGN(const TakenFile file,
                  call<TakenFile>(settings_.answer + from_seconds(exposure_s_),
                                  "taking a picture",
                                  [patience, wait_for_raw](GphotoLink& link) {
                                    return link.shoot(patience, wait_for_raw);
                                  }));
    VENEER_ASSIGN(CameraFrame frame, decode(file));
    if (width_ == 0) {
      width_ = frame.counts.width();
      height_ = frame.counts.height();
    } else if (frame.counts.width() != width_ || frame.counts.height() != height_) {
      return fail(Errc::kBadFormat,
                  "{} has {} x {} pixels where the camera gave {} x {} before; was its picture "
                  "size changed?",
                  file.name,
                  frame.counts.width(),
                  frame.counts.height(),
                  width_,
                  height_);
    }
    return frame;
  }

  /// Finds out how it is set and takes the first picture.
  [[nodiscard]] Status begin() {
    const auto now = shutter_seconds(shutter_.now);
    if (speeds_.empty() || !now) {
      return fail(Errc::kUnavailable,
                  "the camera's shutter speed is \"{}\" and can{} be chosen; turn its mode dial to "
                  "M (manual), and away from bulb",
                  shutter_.now,
                  speeds_.empty() ? "not" : "");
    }
    exposure_s_ = *now;
    return grab().map([](const CameraFrame&) {});
  }

 private:
  template <class T>
  [[nodiscard]] Result<T> call(Duration limit,
                               const std::string& doing,
                               std::function<Result<T>(GphotoLink&)> work) {
    if (!link_) {
      return fail(Errc::kDisconnected,
                  "{}: the camera at {} is gone; open it again",
                  doing,
                  settings_.address.port);
    }
    auto result =
        within<T>(limit, doing, link_, [work = std::move(work)](std::unique_ptr<GphotoLink>& link) {
          return work(*link);
        });
    if (!result && result.error().code == Errc::kDisconnected) close(link_, settings_.answer);
    return result;
  }

  [[nodiscard]] Result<CameraFrame> decode(const TakenFile& file) const {
    CameraFrame frame;
    frame.exposure_s = exposure_s_;
    frame.time = file.begin + from_seconds(0.5 * exposure_s_);
    if (!file.encoded) {
      VENEER_ASSIGN(RawPicture raw, decode_raw(file.bytes, file.name));
      frame.counts = std::move(raw.counts);
      frame.full_scale = raw.full_scale;
      return frame;
    }
    if (!settings_.allow_encoded) {
      return fail(Errc::kInvalidOption,
                  "the camera gave {}, which is not linear in light; set it to RAW (key "
                  "image_format, or in its menu), or say allow_encoded = true and have its curve "
                  "recovered",
                  file.name);
    }
    VENEER_ASSIGN(const Image<Rgb8> picture, decode_jpeg(file.bytes, file.name));
    frame.counts = Image<Rgb16>(picture.width(), picture.height());
    std::transform(picture.pixels().begin(),
                   picture.pixels().end(),
                   frame.counts.pixels().begin(),
                   [](const Rgb8& pixel) {
                     return Rgb16{pixel[0], pixel[1], pixel[2]};
                   });
    frame.full_scale = 255;
    return frame;
  }

  Settings settings_;
  SharedLink link_;  // empty once the camera is gone
  CameraChoice shutter_;
  std::string serial_;
  std::vector<ShutterSpeed> speeds_;
  double exposure_s_ = 0;
  int width_ = 0, height_ = 0;
};

/// The one camera that model and port leave.
Result<GphotoAddress> choose(const GphotoAddress& wanted) {
  if (!wanted.model.empty() && !wanted.port.empty()) return wanted;
  if (wanted.port.starts_with("ptpip:")) return GphotoAddress{"PTP/IP Camera", wanted.port};
  VENEER_ASSIGN(std::vector<GphotoAddress> found, find_gphoto_cameras());
  std::string names;
  for (const GphotoAddress& one : found) {
    names += fmt::format("{}{} at {}", names.empty() ? "" : "; ", one.model, one.port);
  }
  std::erase_if(found, [&](const GphotoAddress& one) {
    return (!wanted.model.empty() && one.model != wanted.model) ||
           (!wanted.port.empty() && one.port != wanted.port);
  });
  if (found.size() == 1) return found.front();
  const std::string which =
      fmt::format("{}{}{}", wanted.model, wanted.port.empty() ? "" : " at ", wanted.port);
  if (found.empty()) {
    return fail(Errc::kNotFound,
                "no camera{}{} is there for libgphoto2 ({}); is it on, awake, and set to PTP where "
                "its menu asks?",
                which.empty() ? "" : " ",
                which,
                names.empty() ? "none at all" : "seen: " + names);
  }
  return fail(Errc::kInvalidOption, "there are several cameras: {}; set the key port", names);
}

}  // namespace

Result<std::unique_ptr<Camera>> open_gphoto2(TomlReader& config) {
  Settings settings;
  int iso = 0;
  double answer_s = to_seconds(settings.answer);
  config.read("model", settings.address.model);
  config.read("port", settings.address.port);
  config.read("iso", iso);
  config.read("white_balance", settings.white_balance);
  config.read("image_format", settings.image_format);
  config.read("allow_encoded", settings.allow_encoded);
  config.read("answer_s", answer_s);
  if (config.contains("iso")) {
    if (iso < 1) return fail(Errc::kInvalidOption, "iso = {}: must be at least 1", iso);
    settings.iso = iso;
  }
  constexpr double kLongest_s = 600;
  if (!(answer_s > 0 && answer_s <= kLongest_s)) {
    return fail(Errc::kInvalidOption,
                "answer_s = {}: must be above 0 and at most {} s",
                answer_s,
                kLongest_s);
  }
  settings.answer = from_seconds(answer_s);

  VENEER_ASSIGN(settings.address, choose(settings.address));
  const auto& [model, port] = settings.address;
  const std::string doing = fmt::format("opening camera {} at {}", model, port);
  auto link = std::make_shared<std::unique_ptr<GphotoLink>>();
  std::function<Result<Opened>(std::unique_ptr<GphotoLink>&)> connect =
      [settings](std::unique_ptr<GphotoLink>& made) -> Result<Opened> {
    VENEER_ASSIGN(made, GphotoLink::open(settings.address));
    return prepare(*made, settings);
  };
  auto opened = within<Opened>(settings.answer, doing, link, std::move(connect));
  if (!opened) {
    close(link, settings.answer);
    return tl::unexpected<Error>(opened.error());
  }
  auto camera = std::make_unique<Gphoto2Camera>(settings, link, std::move(*opened));
  link.reset();
  if (auto begun = camera->begin(); !begun) return fail_while(doing, begun.error());
  return camera;
}

Result<std::vector<CameraInfo>> list_gphoto2() {
  VENEER_ASSIGN(const std::vector<GphotoAddress> found, find_gphoto_cameras());
  std::vector<CameraInfo> cameras;
  cameras.reserve(found.size());
  for (const auto& [model, port] : found) {
    cameras.push_back({"gphoto2", model, port, obstacle(port)});
  }
  return cameras;
}

}  // namespace veneer::capture
