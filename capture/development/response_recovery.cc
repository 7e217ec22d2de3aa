// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Dense>
#include <opencv2/photo.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/statistics.h"
#include "capture/development/response.h"

namespace veneer::capture {
namespace {

constexpr int kOpenCvEntries = 256;
constexpr int kNodes = 65;               // of the refined curve
constexpr int kMostSamples = 60000;      // of pixels in a channel
constexpr double kLeastFraction = 0.02;  // of full scale; below it noise is most of a ratio
constexpr double kMostFraction = 0.97;   // above it frames begin to saturate
constexpr double kCoveredFrom = 0.15;    // what light has to reach down to
constexpr double kCoveredTo = 0.85;      // and up to
/// Weight of the curve's smoothness against that of pixels: second differences of the refinement
/// over the nodes, so that noise does not make steps.
constexpr double kSmoothness = 0.3;
constexpr std::size_t kLeastPairs = 200;

struct Shots {
  std::vector<const Picture*> lit;   ///< shortest first
  std::vector<const Picture*> dark;  ///< of each; null where there is none
};

Result<Shots> sort_out(std::span<const Picture> bracket) {
  Shots shots;
  for (const Picture& picture : bracket) {
    if (!(picture.exposure_s > 0) || !std::isfinite(picture.exposure_s) ||
        !(picture.full_scale > 0) || picture.counts.empty() ||
        picture.counts.width() != bracket.front().counts.width() ||
        picture.counts.height() != bracket.front().counts.height() ||
        picture.full_scale != bracket.front().full_scale) {
      return fail(Errc::kInvalidOption,
                  "recovering the camera's response: a picture of {} x {} pixels has exposure {} s "
                  "and full scale {}; all of a bracket have to be of one size and format",
                  picture.counts.width(),
                  picture.counts.height(),
                  picture.exposure_s,
                  picture.full_scale);
    }
    for (const Rgb32f& counts : picture.counts.pixels())
      if (!counts.allFinite() || !(counts.minCoeff() >= 0))
        return fail(Errc::kInvalidOption,
                    "recovering the camera's response: the picture of {} s has counts that are no "
                    "numbers from 0: it is damaged, take it again",
                    picture.exposure_s);
    if (!picture.shot.dark) shots.lit.push_back(&picture);
  }
  std::ranges::sort(shots.lit, {}, &Picture::exposure_s);
  int different = shots.lit.empty() ? 0 : 1;
  for (std::size_t i = 1; i < shots.lit.size(); ++i)
    different += shots.lit[i]->exposure_s > 1.01 * shots.lit[i - 1]->exposure_s ? 1 : 0;
  if (different < 3) {
    return fail(Errc::kInvalidOption,
                "recovering the camera's response: there are {} different exposures, three are "
                "needed; take a bracket of a scene that does not move, each twice to four times as "
                "long as the one before",
                different);
  }
  for (const Picture* lit : shots.lit) {
    const auto dark = std::ranges::find_if(bracket, [&](const Picture& other) {
      return other.shot.dark &&
             std::abs(other.exposure_s - lit->exposure_s) <= 1e-3 * lit->exposure_s;
    });
    shots.dark.push_back(dark == bracket.end() ? nullptr : &*dark);
  }
  return shots;
}

/// One pixel in two exposures, counts in parts of full scale.
struct Pair {
  double shorter = 0, longer = 0;
  double shorter_dark = 0, longer_dark = 0;
  double ratio = 1;  ///< of the longer exposure to the shorter
};

std::vector<Pair> pairs_of(const Shots& shots, int channel) {
  std::vector<Pair> pairs;
  const auto pixels = static_cast<int>(shots.lit.front()->counts.pixels().size());
  const double full = shots.lit.front()->full_scale;
  const int step = std::max(1, pixels * static_cast<int>(shots.lit.size()) / kMostSamples);
  for (std::size_t i = 0; i + 1 < shots.lit.size(); ++i) {
    const Picture& shorter = *shots.lit[i];
    const Picture& longer = *shots.lit[i + 1];
    if (!(longer.exposure_s > 1.01 * shorter.exposure_s)) continue;
    for (int p = 0; p < pixels; p += step) {
      const auto at = [&](const Picture* picture) {
        return picture ? static_cast<double>(
                             picture->counts.pixels()[static_cast<std::size_t>(p)][channel]) /
                             full
                       : 0.0;
      };
      const Pair pair{.shorter = at(&shorter),
                      .longer = at(&longer),
                      .shorter_dark = at(shots.dark[i]),
                      .longer_dark = at(shots.dark[i + 1]),
                      .ratio = longer.exposure_s / shorter.exposure_s};
      if (pair.shorter >= kLeastFraction && pair.longer <= kMostFraction) pairs.push_back(pair);
    }
  }
  return pairs;
}

/// What OpenCV finds in 8 bits, as light at equally spaced counts.
std::vector<cv::Vec3f> recover_in_8_bits(const Shots& shots, ResponseMethod method) {
  std::vector<cv::Mat> images;
  std::vector<float> seconds;
  for (const Picture* picture : shots.lit) {
    cv::Mat image(picture->counts.height(), picture->counts.width(), CV_8UC3);
    for (int y = 0; y < image.rows; ++y)
      for (int x = 0; x < image.cols; ++x)
        for (int channel = 0; channel < 3; ++channel)
          image.at<cv::Vec3b>(y, x)[channel] = static_cast<std::uint8_t>(std::min(
              255.0, std::round(255 * picture->counts(x, y)[channel] / picture->full_scale)));
    images.push_back(image);
    seconds.push_back(static_cast<float>(picture->exposure_s));
  }
  cv::Mat response;
  if (method == ResponseMethod::kDebevec)
    cv::createCalibrateDebevec()->process(images, response, seconds);
  else
    cv::createCalibrateRobertson()->process(images, response, seconds);
  std::vector<cv::Vec3f> entries;
  for (int i = 0; i < response.rows; ++i) entries.push_back(response.at<cv::Vec3f>(i));
  return entries;
}

/// Makes values rise, each by a little at least, changing them as little as may be (pool adjacent
/// violators).
std::vector<double> rising(const std::vector<double>& values) {
  struct Block {
    double sum, count;
  };
  std::vector<Block> blocks;
  for (const double value : values) {
    blocks.push_back({value, 1});
    while (blocks.size() > 1 && blocks[blocks.size() - 2].sum / blocks[blocks.size() - 2].count >
                                    blocks.back().sum / blocks.back().count) {
      const Block last = blocks.back();
      blocks.pop_back();
      blocks.back().sum += last.sum;
      blocks.back().count += last.count;
    }
  }
  std::vector<double> result;
  for (const Block& block : blocks)
    result.insert(result.end(), static_cast<std::size_t>(block.count), block.sum / block.count);
  const double least =
      1e-5 * std::max(1e-30, result.back() - result.front()) / static_cast<double>(result.size());
  for (std::size_t i = 1; i < result.size(); ++i)
    result[i] = std::max(result[i], result[i - 1] + least);
  return result;
}

/// OpenCV's curve at the nodes: smoothed, rising, 0 at 0 and 1 at 1; a straight line where it is
/// none.
std::vector<double> start_curve(const std::vector<cv::Vec3f>& entries, int channel) {
  std::vector<double> nodes;
  for (int k = 0; k < kNodes; ++k) {
    constexpr int kHalf = 3;
    // The ends are hardly seen; both methods leave them wild.
    const int middle = std::clamp(k * (kOpenCvEntries - 1) / (kNodes - 1), 5, 248);
    std::vector<double> around;
    for (int i = -kHalf; i <= kHalf; ++i)
      around.push_back(entries[static_cast<std::size_t>(middle + i)][channel]);
    nodes.push_back(quantile(around, 0.5));
  }
  nodes = rising(nodes);
  const double first = nodes.front();
  const double range = nodes.back() - first;
  for (int k = 0; k < kNodes; ++k) {
    double& node = nodes[static_cast<std::size_t>(k)];
    node = std::isfinite(range) && range > 0 ? (node - first) / range
                                             : static_cast<double>(k) / (kNodes - 1);
  }
  return nodes;
}

/// Adds a place of the curve, times `factor`, to an equation over the nodes.
void add_place(Eigen::VectorXd& row, double fraction, double factor) {
  const double scaled = std::clamp(fraction, 0.0, 1.0) * (kNodes - 1);
  const int below = std::min(static_cast<int>(scaled), kNodes - 2);
  row[below] += factor * (1 - (scaled - below));
  row[below + 1] += factor * (scaled - below);
}

/// On counts of full depth: the curve whose light in two exposures is as their times are, by least
/// squares; it is linear in the nodes. Each pair counts by its light, so that bright ones do not
/// decide alone.
std::vector<double> refine(const std::vector<Pair>& pairs, const std::vector<double>& start) {
  std::vector<double> nodes = start;
  for (int round = 0; round < 4; ++round) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kNodes, kNodes);
    const auto place = [&](double fraction) {
      Eigen::VectorXd row = Eigen::VectorXd::Zero(kNodes);
      add_place(row, fraction, 1);
      return row.dot(Eigen::Map<const Eigen::VectorXd>(nodes.data(), kNodes));
    };
    Eigen::VectorXd row(kNodes);
    for (const Pair& pair : pairs) {
      row.setZero();
      add_place(row, pair.longer, 1);
      add_place(row, pair.longer_dark, -1);
      add_place(row, pair.shorter, -pair.ratio);
      add_place(row, pair.shorter_dark, pair.ratio);
      // Noise of counts, even over the range, makes this much in the equation.
      const double slope_longer = (place(pair.longer + 0.01) - place(pair.longer - 0.01)) / 0.02;
      const double slope_shorter = (place(pair.shorter + 0.01) - place(pair.shorter - 0.01)) / 0.02;
      const double noise2 =
          slope_longer * slope_longer * (0.05 + pair.longer) +
          pair.ratio * pair.ratio * slope_shorter * slope_shorter * (0.05 + pair.shorter);
      const double weight = 1 / (noise2 + 1e-6);
      // Only eight nodes are not zero.
      std::array<int, 8> used{};
      int count = 0;
      for (int k = 0; k < kNodes; ++k)
        if (row[k] != 0 && count < 8) used[static_cast<std::size_t>(count++)] = k;
      for (int a = 0; a < count; ++a)
        for (int b = 0; b < count; ++b) {
          const int ka = used[static_cast<std::size_t>(a)];
          const int kb = used[static_cast<std::size_t>(b)];
          normal(ka, kb) += weight * row[ka] * row[kb];
        }
    }
    normal /= static_cast<double>(pairs.size());
    // Smooth: second differences against what the slopes are anyway.
    for (int k = 1; k + 1 < kNodes; ++k) {
      Eigen::Matrix3d bend;
      const Eigen::Vector3d second(1, -2, 1);
      bend = kSmoothness * second * second.transpose();
      normal.block<3, 3>(k - 1, k - 1) += bend;
    }
    // The ends are held: 0 at 0, 1 at 1.
    const int inner = kNodes - 2;
    const Eigen::MatrixXd matrix = normal.block(1, 1, inner, inner);
    const Eigen::VectorXd right = -normal.block(1, kNodes - 1, inner, 1);
    const Eigen::VectorXd solved = matrix.ldlt().solve(right);
    if (!solved.allFinite()) return start;
    std::vector<double> next{0};
    for (int k = 0; k < inner; ++k) next.push_back(std::clamp(solved[k], 0.0, 1.0));
    next.push_back(1);
    nodes = rising(next);
    const double first = nodes.front();
    const double range = nodes.back() - first;
    for (double& node : nodes) node = (node - first) / range;
  }
  return nodes;
}

/// Root mean square disagreement of light in two exposures, in parts of full scale of the longer.
double disagreement(const std::array<std::vector<Pair>, 3>& pairs, const ResponseCurve& curve) {
  double sum = 0;
  double count = 0;
  for (int channel = 0; channel < 3; ++channel) {
    for (const Pair& pair : pairs[static_cast<std::size_t>(channel)]) {
      const double longer =
          curve.light(channel, pair.longer) - curve.light(channel, pair.longer_dark);
      const double shorter =
          curve.light(channel, pair.shorter) - curve.light(channel, pair.shorter_dark);
      const double off = longer - pair.ratio * shorter;
      sum += off * off;
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

}  // namespace

Result<RecoveredResponse> recover_response(std::span<const Picture> bracket,
                                           ResponseMethod method) {
  VENEER_ASSIGN(const Shots shots, sort_out(bracket));
  std::array<std::vector<Pair>, 3> pairs;
  for (int channel = 0; channel < 3; ++channel) {
    std::vector<Pair>& own = pairs[static_cast<std::size_t>(channel)];
    own = pairs_of(shots, channel);
    double least = 1;
    double most = 0;
    for (const Pair& pair : own) {
      least = std::min(least, pair.shorter);
      most = std::max(most, pair.longer);
    }
    if (own.size() < kLeastPairs || least > kCoveredFrom || most < kCoveredTo) {
      return fail(Errc::kBadFormat,
                  "recovering the camera's response: in channel {} {} pairs of pixels reach from "
                  "{:.0f} % to {:.0f} % of full scale; {} from {:.0f} % to {:.0f} % are needed: "
                  "take a scene with dark and bright parts, and steps of two to four",
                  channel,
                  own.size(),
                  own.empty() ? 0.0 : 100 * least,
                  100 * most,
                  kLeastPairs,
                  100 * kCoveredFrom,
                  100 * kCoveredTo);
    }
  }
  std::vector<cv::Vec3f> entries;
  try {
    entries = recover_in_8_bits(shots, method);
  } catch (const cv::Exception& error) {
    return fail(Errc::kBadFormat, "recovering the camera's response: OpenCV says {}", error.what());
  }
  if (entries.size() != kOpenCvEntries)
    return fail(Errc::kBadFormat, "recovering the camera's response: OpenCV gives no curve");

  std::array<std::vector<double>, 3> coarse;
  std::array<std::vector<double>, 3> fine;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    coarse[channel] = start_curve(entries, static_cast<int>(channel));
    fine[channel] = refine(pairs[channel], coarse[channel]);
  }
  RecoveredResponse recovered;
  recovered.residual_if_linear = disagreement(pairs, ResponseCurve());
  VENEER_ASSIGN(recovered.curve, ResponseCurve::tabulated(fine));
  recovered.residual = disagreement(pairs, recovered.curve);
  return recovered;
}

}  // namespace veneer::capture
