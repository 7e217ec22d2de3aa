// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/camera.h"
#include "capture/cameras/cameras.h"
#include "capture/cameras/folder/series.h"

namespace veneer::capture {

/// Pictures on disk in the place of a camera, in the order of their names: a bracket of a DSLR that
/// was converted from RAW, for example. Keys: path, full_scale, exposure_s, allow_encoded, layout
/// (docs/howto/camera.md).
///
/// Each exposure has its own row of pictures, and a grab takes the next of the row that is set. The
/// end of a row is kDisconnected. What a grab gives was exposed long ago: its time is that of the
/// call.
class FolderCamera final : public Camera {
 public:
  /// Errors: those of find_series() and read_picture(); kInvalidOption.
  [[nodiscard]] static Result<std::unique_ptr<FolderCamera>> open(TomlReader& config);
  /// None: a folder is not looked for.
  [[nodiscard]] static Result<std::vector<CameraInfo>> list() { return std::vector<CameraInfo>{}; }

  [[nodiscard]] std::string description() const override;
  [[nodiscard]] int width() const override { return width_; }
  [[nodiscard]] int height() const override { return height_; }
  /// Takes the nearest exposure that there is, in stops.
  [[nodiscard]] Status set_exposure(double seconds) override;
  [[nodiscard]] ExposureRange exposure_range() const override;
  [[nodiscard]] Result<CameraFrame> grab() override;

 private:
  struct Row {
    std::vector<std::size_t> pictures;  // indices into series_
    std::size_t next = 0;
  };
  FolderCamera() = default;

  std::filesystem::path folder_;
  std::vector<SeriesPicture> series_;
  std::map<double, Row> rows_;  // by exposure, never empty
  std::map<double, Row>::iterator row_;
  std::uint16_t full_scale_ = 0;  // 0: by the file's depth
  Mosaic mosaic_ = Mosaic::kNone;
  int width_ = 0, height_ = 0;
};

}  // namespace veneer::capture
