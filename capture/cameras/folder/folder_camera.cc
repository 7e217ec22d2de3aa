// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/folder/folder_camera.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "capture/cameras/folder/picture_file.h"
#include "capture/cameras/layout.h"

namespace veneer::capture {
namespace {

/// Exposures that differ by less are one: a camera's 1/60 s is written as 0.0167, 0.01667 or 1/60.
constexpr double kSameExposure = 0.005;

bool same_exposure(double a, double b) { return std::abs(a - b) <= kSameExposure * a; }

}  // namespace

Result<std::unique_ptr<FolderCamera>> FolderCamera::open(TomlReader& config) {
  std::unique_ptr<FolderCamera> camera(new FolderCamera);
  std::filesystem::path path;
  bool allow_encoded = false;
  std::optional<double> exposure_s;
  config.read("path", path);
  config.read("allow_encoded", allow_encoded);
  if (config.contains("exposure_s")) config.read("exposure_s", exposure_s.emplace());
  if (path.empty()) {
    return fail(Errc::kInvalidOption, "opening the camera: set path to the folder of the pictures");
  }
  if (config.contains("full_scale")) {
    int full_scale = 0;
    config.read("full_scale", full_scale);
    if (full_scale < 1 || full_scale > 65535) {
      return fail(
          Errc::kInvalidOption,
          "opening the camera: full_scale is {}; it must be the count of a saturated pixel, "
          "1 to 65535 (16383 for 14 bits that were not spread over 16)",
          full_scale);
    }
    camera->full_scale_ = static_cast<std::uint16_t>(full_scale);
  }
  VENEER_ASSIGN(camera->mosaic_, read_layout(config));
  camera->folder_ = path.is_absolute() ? path : config.folder() / path;
  VENEER_ASSIGN(camera->series_, find_series(camera->folder_, exposure_s, allow_encoded));

  for (std::size_t i = 0; i < camera->series_.size(); ++i) {
    const double seconds = camera->series_[i].exposure_s;
    auto row = std::ranges::find_if(
        camera->rows_, [&](const auto& each) { return same_exposure(each.first, seconds); });
    if (row == camera->rows_.end()) row = camera->rows_.emplace(seconds, Row{}).first;
    row->second.pictures.push_back(i);
  }
  camera->row_ = camera->rows_.begin();

  VENEER_ASSIGN(const PictureCounts first,
                read_picture(camera->series_.front().path, camera->full_scale_));
  camera->width_ = first.counts.width();
  camera->height_ = first.counts.height();
  if (const Status whole = check_layout(camera->mosaic_, camera->width_, camera->height_); !whole) {
    return fail_while(fmt::format("opening the camera: {}", camera->series_.front().path.string()),
                      whole.error());
  }
  return camera;
}

std::string FolderCamera::description() const {
  return fmt::format(
      "folder: {} pictures of {} exposures in {}", series_.size(), rows_.size(), folder_.string());
}

ExposureRange FolderCamera::exposure_range() const {
  return {rows_.begin()->first, rows_.rbegin()->first};
}

Status FolderCamera::set_exposure(double seconds) {
  const auto [least, most] = exposure_range();
  // The negation refuses NaN, too.
  if (!(seconds >= least * (1 - kSameExposure) && seconds <= most * (1 + kSameExposure))) {
    return fail(Errc::kInvalidOption,
                "{}: no picture was exposed {} s; those that there are run from {} to {} s",
                description(),
                seconds,
                least,
                most);
  }
  row_ = std::ranges::min_element(
      rows_, {}, [&](const auto& each) { return std::abs(std::log(each.first / seconds)); });
  return {};
}

Result<CameraFrame> FolderCamera::grab() {
  Row& row = row_->second;
  if (row.next == row.pictures.size()) {
    return fail(Errc::kDisconnected,
                "{}: no more pictures of {} s; all {} were taken. Open it again to begin anew, or "
                "add those that are missing",
                description(),
                row_->first,
                row.pictures.size());
  }
  const std::size_t index = row.pictures[row.next];
  const SeriesPicture& picture = series_[index];
  VENEER_ASSIGN(PictureCounts read, read_picture(picture.path, full_scale_));
  if (read.counts.width() != width_ || read.counts.height() != height_) {
    return fail(
        Errc::kBadFormat,
        "reading {}: it has {} x {} pixels, the first of the series {} x {}; convert all of "
        "them alike, without cropping and turning (dcraw -t 0)",
        picture.path.string(),
        read.counts.width(),
        read.counts.height(),
        width_,
        height_);
  }
  if (mosaic_ != Mosaic::kNone && std::ranges::any_of(read.counts.pixels(), [](const Rgb16& pixel) {
        return pixel[0] != pixel[1] || pixel[1] != pixel[2];
      })) {
    return fail(Errc::kBadFormat,
                "reading {}: it has colours, and the pixels of a mosaic are grey: it was "
                "interpolated; convert it without (dcraw -D -4 -T), or leave layout out",
                picture.path.string());
  }
  // Only what was read counts as taken: a file that is repaired can be grabbed again.
  ++row.next;
  CameraFrame frame;
  frame.counts = std::move(read.counts);
  frame.full_scale = read.full_scale;
  frame.exposure_s = picture.exposure_s;
  frame.time = SteadyClock().now();
  frame.mosaic = mosaic_;
  frame.sequence = index + 1;
  return frame;
}

}  // namespace veneer::capture
