// SPDX-License-Identifier: Apache-2.0
#include <opencv2/core.hpp>

#include <cmath>

#include "calibration/geometry/bundle_adjustment.h"

namespace veneer::geometry {
namespace {

/// A matrix of doubles; empty where it is missing or has another size.
cv::Mat read_matrix(const cv::FileStorage& storage, const char* name, std::size_t values) {
  cv::Mat matrix;
  const cv::FileNode node = storage[name];
  if (node.empty()) return matrix;
  node >> matrix;
  if (matrix.total() < values || matrix.channels() != 1) return {};
  cv::Mat doubles;
  matrix.convertTo(doubles, CV_64F);
  for (std::size_t i = 0; i < values; ++i) {
    if (!std::isfinite(doubles.ptr<double>()[i])) return {};
  }
  return doubles;
}

constexpr double kCentre = 0.5;  // OpenCV's first pixel centre is (0, 0), ours (0.5, 0.5)

Lens lens_of(const cv::Mat& k, const cv::Mat& distortion) {
  const auto* d = distortion.ptr<double>();
  return {k.at<double>(0, 0),
          k.at<double>(1, 1),
          k.at<double>(0, 2) + kCentre,
          k.at<double>(1, 2) + kCentre,
          d[0],
          d[1],
          d[2],
          d[3],
          d[4]};
}

}  // namespace

Result<Rig> read_opencv_rig(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored))
    return fail(Errc::kNotFound, "reading {}: there is no such file", path.string());
  const auto damaged = [&](const std::string& why) {
    return fail(Errc::kBadFormat,
                "reading {}: {}; a result of procam-calibration is wanted, with cam_int, cam_dist, "
                "proj_int, proj_dist, rotation and translation",
                path.string(),
                why);
  };
  try {
    const cv::FileStorage storage(path.string(), cv::FileStorage::READ);
    if (!storage.isOpened()) return damaged("it is no storage of OpenCV's");
    const cv::Mat camera = read_matrix(storage, "cam_int", 9);
    const cv::Mat camera_distortion = read_matrix(storage, "cam_dist", 5);
    const cv::Mat projector = read_matrix(storage, "proj_int", 9);
    const cv::Mat projector_distortion = read_matrix(storage, "proj_dist", 5);
    cv::Mat rotation = read_matrix(storage, "roration", 9);  // as its writer spells it
    if (rotation.empty()) rotation = read_matrix(storage, "rotation", 9);
    const cv::Mat translation = read_matrix(storage, "translation", 3);
    for (const auto& [name, matrix] : {std::pair{"cam_int", &camera},
                                       {"cam_dist", &camera_distortion},
                                       {"proj_int", &projector},
                                       {"proj_dist", &projector_distortion},
                                       {"rotation", &rotation},
                                       {"translation", &translation}}) {
      if (matrix->empty()) return damaged(fmt::format("{} is missing or damaged", name));
    }
    Rig rig;
    rig.camera = lens_of(camera, camera_distortion);
    rig.projector = lens_of(projector, projector_distortion);
    if (!(rig.camera.fx > 0 && rig.camera.fy > 0 && rig.projector.fx > 0 && rig.projector.fy > 0))
      return damaged("a focal length is not above 0");
    Eigen::Matrix3d turn;
    for (int i = 0; i < 9; ++i) turn(i / 3, i % 3) = rotation.ptr<double>()[i];
    constexpr double kRotationTolerance = 1e-6;  // files keep 16 digits
    if (!(turn * turn.transpose()).isIdentity(kRotationTolerance) || turn.determinant() < 0)
      return damaged("its rotation is none");
    rig.projector_from_camera.rotation = Eigen::Quaterniond(turn);
    const auto* t = translation.ptr<double>();
    rig.projector_from_camera.translation = {t[0], t[1], t[2]};
    return rig;
  } catch (const cv::Exception& error) {
    return damaged(error.what());
  }
}

}  // namespace veneer::geometry
