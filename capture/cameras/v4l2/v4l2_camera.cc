// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/v4l2/v4l2_camera.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/videoio.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include "capture/cameras/v4l2/internal_node.h"

namespace veneer::capture {
namespace {

constexpr int kBuffers = 4;        // of OpenCV's queue
constexpr int kSettling = 3;       // frames that a sensor still exposes as before
constexpr double kSlowest_s = 10;  // no answer for so long is none; OpenCV's own limit of one read

struct Settings {
  std::filesystem::path device;
  std::string format;
  int width = 0, height = 0;
  double fps = 0;
  int bits = 16;
  int gain = 0;
  bool has_gain = false;
};

class V4l2Camera final : public Camera {
 public:
  V4l2Camera(Settings settings, V4l2Node node)
      : settings_(std::move(settings)), node_(std::move(node)) {}

  [[nodiscard]] std::string description() const override {
    return fmt::format(
        "v4l2, {}, {}, {}", settings_.device.string(), node_.model(), picture_.format);
  }
  [[nodiscard]] int width() const override { return picture_.width; }
  [[nodiscard]] int height() const override { return picture_.height; }
  [[nodiscard]] ExposureRange exposure_range() const override {
    return exposure_ ? exposure_->range() : ExposureRange{};
  }

  [[nodiscard]] Status set_exposure(double seconds) override {
    if (!exposure_) {
      return fail(
          Errc::kUnavailable, "{} has no exposure that could be set", settings_.device.string());
    }
    VENEER_ASSIGN(exposure_s_, exposure_->set(node_, seconds));
    to_settle_ = kSettling;
    return {};
  }

  [[nodiscard]] std::vector<std::string> pixel_formats() const override {
    std::vector<std::string> names = node_.formats();
    std::stable_partition(names.begin(), names.end(), [this](const std::string& name) {
      return name == picture_.format;
    });
    return names;
  }
  [[nodiscard]] Status set_pixel_format(std::string_view name) override {
    const Settings before = settings_;
    settings_.format = name;
    Status set = begin();
    if (set) return set;
    settings_ = before;
    VENEER_TRY(begin());  // as it was; unless it is gone, which is the error then
    return set;
  }

  [[nodiscard]] Result<CameraFrame> grab() override {
    const Time begin = SteadyClock().now();
    const std::string doing = fmt::format("taking a picture with {}", settings_.device.string());
    const Duration exposure = from_seconds(exposure_s_);
    const Time deadline =
        begin + from_seconds(kSlowest_s) + (kBuffers + 1 + to_settle_) * 2 * exposure;
    int unstamped = 0;
    while (SteadyClock().now() < deadline) {
      cv::Mat picture;
      VENEER_ASSIGN(const Time stamp, read(doing, picture));
      const Time now = SteadyClock().now();
      const bool stamped = stamp > now - std::chrono::minutes(1) && stamp <= now;
      // A stamp is of the end of the exposure with most drivers: of its begin with others, for
      // which this is one picture too many.
      if (stamped ? stamp - exposure < begin : unstamped++ < kBuffers + 1) continue;
      if (to_settle_ > 0) {
        --to_settle_;
        continue;
      }
      const Time end = stamped ? stamp : now;
      return frame_of(doing, picture, end - exposure / 2);
    }
    return fail(Errc::kTimeout, "{}: none came that began after the call; try again", doing);
  }

  /// Streams as the settings say, from the start.
  [[nodiscard]] Status begin() {
    const std::string doing = fmt::format("opening camera {}", settings_.device.string());
    const std::vector<std::string> formats = node_.formats();
    std::uint32_t code = 0;
    if (!settings_.format.empty()) {
      VENEER_ASSIGN(code, format_code(settings_.format));
      if (std::find(formats.begin(), formats.end(), settings_.format) == formats.end()) {
        return fail(Errc::kInvalidOption,
                    "{}: it has no format {}; it has {}",
                    doing,
                    settings_.format,
                    fmt::join(formats, ", "));
      }
    }
    stream_.release();
    VENEER_TRY(node_.check_free());
    VENEER_ASSIGN(const V4l2Node::Picture before, node_.picture());
    const std::string format = settings_.format.empty() ? before.format : settings_.format;
    if (code == 0) {
      VENEER_ASSIGN(code, format_code(format));
    }
    const bool raw = format == "Y16" || format == "GREY";
    try {
      stream_.open(settings_.device.string(), cv::CAP_V4L2);
      if (!stream_.isOpened()) {
        VENEER_TRY(node_.check_free());
        return fail(
            Errc::kIo, "{}: OpenCV cannot stream from it; OPENCV_LOG_LEVEL=DEBUG says why", doing);
      }
      stream_.set(cv::CAP_PROP_BUFFERSIZE, kBuffers);
      stream_.set(cv::CAP_PROP_FOURCC, static_cast<double>(code));
      stream_.set(cv::CAP_PROP_FRAME_WIDTH, settings_.width > 0 ? settings_.width : before.width);
      stream_.set(cv::CAP_PROP_FRAME_HEIGHT,
                  settings_.height > 0 ? settings_.height : before.height);
      if (settings_.fps > 0) stream_.set(cv::CAP_PROP_FPS, settings_.fps);
      stream_.set(cv::CAP_PROP_CONVERT_RGB, raw ? 0 : 1);
      fps_ = stream_.get(cv::CAP_PROP_FPS);
    } catch (const cv::Exception& error) {
      return fail(Errc::kIo, "{}: {}", doing, error.what());
    }
    VENEER_ASSIGN(picture_, node_.picture());
    if (picture_.format != format) {
      return fail(Errc::kInvalidOption,
                  "{}: OpenCV cannot read its format {}, and took {}",
                  doing,
                  format,
                  picture_.format);
    }
    if ((settings_.width > 0 && picture_.width != settings_.width) ||
        (settings_.height > 0 && picture_.height != settings_.height)) {
      return fail(Errc::kInvalidOption,
                  "{}: it has no pictures of {} x {} in format {}, the nearest are {} x {}; "
                  "`v4l2-ctl -d {} --list-formats-ext` lists what it has",
                  doing,
                  settings_.width,
                  settings_.height,
                  format,
                  picture_.width,
                  picture_.height,
                  settings_.device.string());
    }
    if (!(fps_ > 0) || !std::isfinite(fps_)) fps_ = 30;  // a driver that does not say
    VENEER_TRY(switch_automatics_off(node_));
    if (settings_.has_gain) {
      const int error = node_.write(V4L2_CID_GAIN, settings_.gain);
      std::int32_t now = 0;
      if (error != 0 || node_.read(V4L2_CID_GAIN, now) != 0 || now != settings_.gain) {
        v4l2_queryctrl gain{};
        if (node_.query(V4L2_CID_GAIN, gain) != 0) {
          return fail(Errc::kUnavailable, "{}: it has no gain to set", doing);
        }
        return fail(Errc::kInvalidOption,
                    "{}: gain = {} is none of its {} to {} in steps of {}",
                    doing,
                    settings_.gain,
                    gain.minimum,
                    gain.maximum,
                    gain.step);
      }
    }
    VENEER_ASSIGN(exposure_, ExposureControl::find(node_));
    exposure_s_ = 1 / fps_;
    if (exposure_) {
      VENEER_ASSIGN(exposure_s_, exposure_->read(node_));
    }
    to_settle_ = kSettling;
    return {};
  }

 private:
  /// The next picture of the queue and its stamp.
  [[nodiscard]] Result<Time> read(const std::string& doing, cv::Mat& picture) {
    bool read = false;
    double stamp_ms = 0;
    if (!node_.is_there()) return control_failed(doing, ENODEV);
    try {
      read = stream_.read(picture);
      stamp_ms = stream_.get(cv::CAP_PROP_POS_MSEC);
    } catch (const cv::Exception& error) {
      // A picture that it cannot decode, or one that is not of the size that was agreed.
      return fail(
          Errc::kBadFormat, "{}: a damaged picture came ({}); try again", doing, error.what());
    }
    if (read && !picture.empty()) return Time{from_seconds(stamp_ms * 1e-3)};
    if (!node_.is_there()) return control_failed(doing, ENODEV);
    return fail(Errc::kTimeout,
                "{}: none came; try again, and plug the camera into a port of its own if that goes "
                "on: several on one USB bus starve each other",
                doing);
  }

  [[nodiscard]] Result<CameraFrame> frame_of(const std::string& doing,
                                             const cv::Mat& picture,
                                             Time time) const {
    if (picture.cols != picture_.width || picture.rows != picture_.height) {
      return fail(Errc::kBadFormat,
                  "{}: a picture of {} x {} came where {} x {} was agreed",
                  doing,
                  picture.cols,
                  picture.rows,
                  picture_.width,
                  picture_.height);
    }
    CameraFrame frame;
    frame.counts = Image<Rgb16>(picture.cols, picture.rows);
    frame.exposure_s = exposure_s_;
    frame.time = time;
    frame.full_scale = 255;
    for (int y = 0; y < picture.rows; ++y) {
      const auto row = frame.counts.view().row(y);
      switch (picture.type()) {
        case CV_8UC3:  // blue first
          std::transform(picture.ptr<cv::Vec3b>(y),
                         picture.ptr<cv::Vec3b>(y) + picture.cols,
                         row.begin(),
                         [](const cv::Vec3b& pixel) {
                           return Rgb16{pixel[2], pixel[1], pixel[0]};
                         });
          break;
        case CV_8UC1:
          std::transform(
              picture.ptr(y), picture.ptr(y) + picture.cols, row.begin(), [](std::uint8_t count) {
                return Rgb16{count, count, count};
              });
          break;
        case CV_16UC1:
          frame.full_scale = static_cast<std::uint16_t>((1 << settings_.bits) - 1);
          std::transform(picture.ptr<std::uint16_t>(y),
                         picture.ptr<std::uint16_t>(y) + picture.cols,
                         row.begin(),
                         [](std::uint16_t count) {
                           return Rgb16{count, count, count};
                         });
          break;
        default:
          return fail(
              Errc::kBadFormat, "{}: OpenCV gave pixels of its type {}", doing, picture.type());
      }
    }
    return frame;
  }

  Settings settings_;
  V4l2Node node_;
  cv::VideoCapture stream_;
  V4l2Node::Picture picture_;
  std::optional<ExposureControl> exposure_;
  double exposure_s_ = 0;
  double fps_ = 0;
  int to_settle_ = 0;
};

/// The link of /dev/v4l/by-id that leads to a node, which stays when others are plugged in; else
/// the node.
std::string lasting_name(const std::filesystem::path& node) {
  std::error_code gone;
  for (std::filesystem::directory_iterator entry("/dev/v4l/by-id", gone), end;
       !gone && entry != end;
       entry.increment(gone)) {
    std::error_code broken;
    if (std::filesystem::equivalent(entry->path(), node, broken)) return entry->path().string();
  }
  return node.string();
}

}  // namespace

Result<std::unique_ptr<Camera>> open_v4l2(TomlReader& config) {
  Settings settings;
  config.read("device", settings.device);
  config.read("format", settings.format);
  config.read("width", settings.width);
  config.read("height", settings.height);
  config.read("fps", settings.fps);
  config.read("bits", settings.bits);
  config.read("gain", settings.gain);
  settings.has_gain = config.contains("gain");
  constexpr int kWidest = 1 << 15;
  const auto in_range = [](int value) { return value >= 1 && value <= kWidest; };
  if ((config.contains("width") && !in_range(settings.width)) ||
      (config.contains("height") && !in_range(settings.height)) ||
      config.contains("width") != config.contains("height")) {
    return fail(Errc::kInvalidOption, "width and height go together, each 1 to {}", kWidest);
  }
  if (config.contains("fps") && !(settings.fps > 0 && settings.fps <= 1000)) {
    return fail(Errc::kInvalidOption, "fps = {}: must be above 0 and at most 1000", settings.fps);
  }
  if (settings.bits < 9 || settings.bits > 16) {
    return fail(Errc::kInvalidOption, "bits = {}: must be 9 to 16", settings.bits);
  }
  if (settings.device.empty()) {
    const std::vector<V4l2Device> devices = v4l2_devices();
    if (devices.empty()) {
      return fail(Errc::kNotFound, "no camera of V4L2 is there; is it plugged in?");
    }
    if (devices.size() > 1) {
      std::string names;
      for (const V4l2Device& device : devices) {
        names += fmt::format(
            "{}{} ({})", names.empty() ? "" : ", ", lasting_name(device.node), device.model);
      }
      return fail(Errc::kInvalidOption, "there are several cameras: {}; set the key device", names);
    }
    settings.device = devices.front().node;
  }
  VENEER_ASSIGN(V4l2Node node, V4l2Node::open(settings.device));
  auto camera = std::make_unique<V4l2Camera>(std::move(settings), std::move(node));
  VENEER_TRY(camera->begin());
  return camera;
}

Result<std::vector<CameraInfo>> list_v4l2() {
  std::vector<CameraInfo> cameras;
  for (const V4l2Device& device : v4l2_devices()) {
    cameras.push_back({"v4l2", device.model, lasting_name(device.node), device.state});
  }
  return cameras;
}

}  // namespace veneer::capture
