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
constexpr int kNodes = 40;               // of the refined curve, evenly in the logarithm of counts
constexpr int kEntries = 1025;           // of the table that is handed on
constexpr int kMostSamples = 60000;      // of pixels in a channel
constexpr double kLeastFraction = 0.02;  // of full scale; below it noise is most of a ratio
constexpr double kMostFraction = 0.99;   // above it frames begin to saturate
constexpr double kCoveredFrom = 0.15;    // what light has to reach down to
constexpr double kCoveredTo = 0.85;      // and up to
/// Weight of the refined curve's second differences against that of all pairs. Power laws have
/// none: a linear camera and a gamma come out whatever it is.
constexpr double kSmoothness = 1e-2;
constexpr double kLeastPower = 0.2, kMostPower = 5;  // by which light goes with counts near black
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

double node_fraction(double node) {
  return kLeastFraction * std::pow(1 / kLeastFraction, node / (kNodes - 1));
}

/// A curve as the logarithm of light at nodes; 0 at full scale.
class LogCurve {
 public:
  explicit LogCurve(std::vector<double> logs) : logs_(std::move(logs)) {}
  struct Place {
    int below = 0;
    double part = 0;
  };
  [[nodiscard]] static Place place_of(double fraction) {
    const double scaled = std::log(fraction / kLeastFraction) / std::log(1 / kLeastFraction);
    const double node = std::clamp(scaled, 0.0, 1.0) * (kNodes - 1);
    const int below = std::min(static_cast<int>(node), kNodes - 2);
    return {below, node - below};
  }
  /// Below the nodes a power law goes on.
  [[nodiscard]] double light(double fraction) const {
    if (!(fraction > 0)) return 0;
    if (fraction < kLeastFraction) {
      const double power = (logs_[4] - logs_[0]) / std::log(node_fraction(4) / node_fraction(0));
      return std::exp(logs_[0]) *
             std::pow(fraction / kLeastFraction, std::clamp(power, kLeastPower, kMostPower));
    }
    const auto [below, part] = place_of(fraction);
    return std::exp((1 - part) * logs_[static_cast<std::size_t>(below)] +
                    part * logs_[static_cast<std::size_t>(below + 1)]);
  }
  [[nodiscard]] std::vector<double> table() const {
    std::vector<double> light_at;
    for (int i = 0; i < kEntries; ++i)
      light_at.push_back(light(static_cast<double>(i) / (kEntries - 1)));
    return rising(light_at);
  }

 private:
  std::vector<double> logs_;
};

/// OpenCV's curve at the nodes: smoothed and rising; linear where it is none.
LogCurve start_curve(const std::vector<cv::Vec3f>& entries, int channel) {
  std::vector<double> logs;
  for (int k = 0; k < kNodes; ++k) {
    constexpr int kHalf = 3;
    // The ends are hardly seen; both methods leave them wild.
    const int middle =
        std::clamp(static_cast<int>(std::round(node_fraction(k) * (kOpenCvEntries - 1))), 4, 250);
    std::vector<double> around;
    for (int i = -kHalf; i <= kHalf; ++i)
      around.push_back(entries[static_cast<std::size_t>(middle + i)][channel]);
    const double light = quantile(around, 0.5);
    logs.push_back(light > 0 && std::isfinite(light) ? std::log(light)
                                                     : std::log(node_fraction(k)));
  }
  logs = rising(logs);
  const double last = logs.back();
  for (double& log : logs) log -= last;
  return LogCurve(logs);
}

/// On counts of full depth: the curve whose light in two exposures is as their times are, by least
/// squares in its logarithm (Debevec and Malik 1997, equation 3), over the logarithm of counts.
/// Dark is taken off by what the curve of the round before says of it.
LogCurve refine(const std::vector<Pair>& pairs, const LogCurve& start) {
  LogCurve curve = start;
  for (int round = 0; round < 5; ++round) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kNodes, kNodes);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(kNodes);
    double weights = 0;
    for (const Pair& pair : pairs) {
      const double longer = 1 - curve.light(pair.longer_dark) / curve.light(pair.longer);
      const double shorter = 1 - curve.light(pair.shorter_dark) / curve.light(pair.shorter);
      if (!(longer > 0.5 && shorter > 0.5)) continue;  // hardly above dark
      const double wanted = std::log(pair.ratio) - std::log(longer) + std::log(shorter);
      // Shot noise and some of reading, in parts of the counts.
      const auto noise = [](double fraction) { return (0.02 + fraction) / (fraction * fraction); };
      const double weight = 1 / (noise(pair.longer) + noise(pair.shorter));
      const auto [l, l_part] = LogCurve::place_of(pair.longer);
      const auto [s, s_part] = LogCurve::place_of(pair.shorter);
      const std::array<std::pair<int, double>, 4> terms{
          {{l, 1 - l_part}, {l + 1, l_part}, {s, s_part - 1}, {s + 1, -s_part}}};
      for (const auto& [a, factor_a] : terms) {
        right[a] += weight * factor_a * wanted;
        for (const auto& [b, factor_b] : terms) normal(a, b) += weight * factor_a * factor_b;
      }
      weights += weight;
    }
    if (!(weights > 0)) return start;
    normal /= weights;
    right /= weights;
    const Eigen::Vector3d second(1, -2, 1);
    for (int k = 1; k + 1 < kNodes; ++k)
      normal.block<3, 3>(k - 1, k - 1) += kSmoothness * second * second.transpose();
    // The last is held at 0.
    const Eigen::MatrixXd matrix = normal.topLeftCorner(kNodes - 1, kNodes - 1);
    const Eigen::VectorXd solved = matrix.ldlt().solve(right.head(kNodes - 1));
    if (!solved.allFinite()) return start;
    std::vector<double> logs(solved.data(), solved.data() + solved.size());
    logs.push_back(0);
    logs = rising(logs);
    const double last = logs.back();
    for (double& log : logs) log -= last;
    curve = LogCurve(logs);
  }
  return curve;
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
    const LogCurve start = start_curve(entries, static_cast<int>(channel));
    coarse[channel] = start.table();
    fine[channel] = refine(pairs[channel], start).table();
  }
  RecoveredResponse recovered;
  recovered.residual_if_linear = disagreement(pairs, ResponseCurve());
  VENEER_ASSIGN(recovered.curve, ResponseCurve::tabulated(fine));
  recovered.residual = disagreement(pairs, recovered.curve);
  VENEER_ASSIGN(const ResponseCurve opencv, ResponseCurve::tabulated(coarse));
  if (const double residual = disagreement(pairs, opencv); residual < recovered.residual) {
    recovered.curve = opencv;
    recovered.residual = residual;
  }
  return recovered;
}

}  // namespace veneer::capture
