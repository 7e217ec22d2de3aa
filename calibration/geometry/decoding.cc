// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/decoding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace veneer::geometry {
namespace {

/// Of a normal distribution's inner 80 %, relative to the whole: what is left when both tails,
/// where gross errors are, have been cut.
constexpr double kInnerPart = 0.8;
constexpr double kInnerDeviation = 0.6616;
constexpr std::size_t kNoiseBins = 16;    // of brightness: light has noise of its own
constexpr std::size_t kLeastOfBin = 200;  // pixels, for a deviation to 5 %
/// Counts are whole: what is rounded is off by this, root mean square.
constexpr double kRoundingDeviation = 0.2887;
/// Where fewer of the pixels are lit than this, there is nothing to be read.
constexpr double kLeastLitRatio = 1e-4;
/// A pixel is lit where a bit of a quarter of the usual contrast would still be sure: the finest
/// bits are blurred that much.
constexpr double kLitDeviations = 4;
constexpr std::size_t kMostBits = 14;  // of an axis: patterns.h has sides up to 2^14
/// Of a decoded pixel, so that 0 means that it is not.
constexpr float kLeastConfidence = 1e-3F;

double quantile_of(std::vector<float> values, double rank) {
  if (values.empty()) return 0;
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(rank * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// The pictures of a sequence with their plan, and what is derived for all pixels at once.
class Sequence {
 public:
  Sequence(std::span<const GreyPicture> pictures,
           const PatternPlan& plan,
           const DecodingOptions& options)
      : pictures_(pictures), plan_(plan), options_(options) {
    const std::size_t phases = plan.shifts > 0 ? static_cast<std::size_t>(2 * plan.shifts) : 0;
    first_phase_ = pictures.size() - 2 - phases;
    first_row_bit_ = static_cast<std::size_t>(2 * plan.column_bits);
    estimate_noise();
    find_lit();
  }

  [[nodiscard]] std::size_t pixels() const { return pictures_[0].pixels().size(); }
  /// The median over the lit pixels.
  [[nodiscard]] double noise() const { return typical_noise_; }
  /// White minus black.
  [[nodiscard]] double range(std::size_t pixel) const {
    return at(pictures_.size() - 2, pixel) - at(pictures_.size() - 1, pixel);
  }
  [[nodiscard]] bool is_lit(std::size_t pixel) const { return lit_[pixel]; }

  /// A position along one axis, in pixels from the raster's border; NaN where it is unknown.
  /// @param contrast  lowered to the least of the bits that were used.
  /// @param sure  counted up for every picture of the axis whose bit is sure.
  [[nodiscard]] double position(std::size_t pixel,
                                PatternAxis axis,
                                double& contrast,
                                std::vector<std::int64_t>& sure) const {
    const double gray = gray_position(pixel, axis, contrast, sure);
    if (plan_.shifts == 0) return gray;
    return phase_position(pixel, axis, gray, contrast, sure);
  }

 private:
  [[nodiscard]] double at(std::size_t picture, std::size_t pixel) const {
    return pictures_[picture].pixels()[pixel];
  }

  /// Of a count at the pixel, by how bright it is.
  [[nodiscard]] double noise_at(std::size_t pixel) const {
    const auto bin = std::ranges::upper_bound(noise_levels_, level(pixel)) - noise_levels_.begin();
    return noises_[static_cast<std::size_t>(bin)];
  }
  [[nodiscard]] double level(std::size_t pixel) const {
    return at(pictures_.size() - 2, pixel) + at(pictures_.size() - 1, pixel);
  }

  /// How large the differences between pictures and inverses are: the light that comes straight
  /// from the projector, since what comes by way of other surfaces is nearly the same in both.
  [[nodiscard]] double direct_light(std::size_t pixel) const {
    std::array<double, 2 * kMostBits> differences{};
    const std::size_t count = first_phase_ / 2;
    for (std::size_t i = 0; i < count; ++i)
      differences[i] = std::abs(at(2 * i, pixel) - at(2 * i + 1, pixel));
    const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(
        differences.begin(), middle, differences.begin() + static_cast<std::ptrdiff_t>(count));
    return *middle;
  }

  /// Half of the raster is lit in any picture of a Gray code, so that picture and inverse add up to
  /// the same whatever the bit; what is left of the difference of two such sums is noise.
  void estimate_noise() {
    std::vector<float> levels;
    for (std::size_t i = 0; i < pixels(); ++i) levels.push_back(static_cast<float>(level(i)));
    const std::size_t bins = std::clamp<std::size_t>(pixels() / kLeastOfBin, 1, kNoiseBins);
    std::ranges::sort(levels);
    for (std::size_t bin = 1; bin < bins; ++bin)
      noise_levels_.push_back(levels[bin * levels.size() / bins]);
    const auto [first, last] = std::ranges::unique(noise_levels_);
    noise_levels_.erase(first, last);
    std::vector<std::vector<float>> differences(noise_levels_.size() + 1);
    const std::size_t rows = first_row_bit_;
    for (std::size_t i = 0; i < pixels(); ++i) {
      const auto bin = std::ranges::upper_bound(noise_levels_, level(i)) - noise_levels_.begin();
      differences[static_cast<std::size_t>(bin)].push_back(
          static_cast<float>(at(0, i) + at(1, i) - at(rows, i) - at(rows + 1, i)));
    }
    for (std::vector<float>& bin : differences) {
      std::ranges::sort(bin);
      const auto cut =
          static_cast<std::size_t>((1 - kInnerPart) / 2 * static_cast<double>(bin.size()));
      double sum = 0;
      double squares = 0;
      const auto inner = std::span(bin).subspan(cut, bin.size() - 2 * cut);
      for (const float each : inner) {
        sum += each;
        squares += static_cast<double>(each) * each;
      }
      const double count = std::max(1.0, static_cast<double>(inner.size()));
      const double variance = std::max(0.0, squares / count - sum * sum / (count * count));
      // A difference of four counts has twice the deviation of one.
      noises_.push_back(std::max(kRoundingDeviation, std::sqrt(variance) / kInnerDeviation / 2));
    }
  }

  void find_lit() {
    lit_.resize(pixels());
    std::vector<float> direct(pixels());
    std::vector<float> above_noise;
    for (std::size_t i = 0; i < pixels(); ++i) {
      direct[i] = static_cast<float>(std::min(direct_light(i), std::max(0.0, range(i))));
      if (direct[i] >
          kLitDeviations * options_.least_deviations * std::numbers::sqrt2 * noise_at(i))
        above_noise.push_back(direct[i]);
    }
    const double least = options_.least_lit * quantile_of(above_noise, 0.95);
    std::vector<float> noises;
    for (std::size_t i = 0; i < pixels(); ++i) {
      const double noise = noise_at(i);
      lit_[i] =
          direct[i] >
          std::max(least, kLitDeviations * options_.least_deviations * std::numbers::sqrt2 * noise);
      if (lit_[i]) noises.push_back(static_cast<float>(noise));
    }
    typical_noise_ = quantile_of(std::move(noises), 0.5);
  }

  [[nodiscard]] double gray_position(std::size_t pixel,
                                     PatternAxis axis,
                                     double& contrast,
                                     std::vector<std::int64_t>& sure) const {
    const bool columns = axis == PatternAxis::kColumns;
    const int bits = columns ? plan_.column_bits : plan_.row_bits;
    const std::size_t first = columns ? 0 : first_row_bit_;
    const double lit = range(pixel);
    const double deviation = std::numbers::sqrt2 * noise_at(pixel);
    const double least =
        std::max(options_.least_deviations * deviation, options_.least_contrast * lit);
    unsigned gray = 0;
    unsigned unsure = 0;
    double least_contrast = contrast;
    for (int i = 0; i < bits; ++i) {
      const std::size_t picture = first + static_cast<std::size_t>(2 * i);
      const double difference = at(picture, pixel) - at(picture + 1, pixel);
      const unsigned mask = 1U << static_cast<unsigned>(bits - 1 - i);
      if (difference > 0) gray |= mask;
      if (std::abs(difference) <= least) {
        unsure |= mask;
        continue;
      }
      ++sure[picture];
      ++sure[picture + 1];
      least_contrast = std::min(
          least_contrast, (std::abs(difference) - options_.least_deviations * deviation) / lit);
    }
    contrast = least_contrast;
    const int codes = ((columns ? plan_.width : plan_.height) + plan_.step - 1) / plan_.step;
    const int code = code_of(gray);
    constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
    if (unsure == 0) return code < codes ? plan_.step * (code + 0.5) : kUnknown;
    if ((unsure & (unsure - 1)) != 0) return kUnknown;  // more than one
    // Neighbouring codes differ in one bit, which is where their blocks meet.
    const int other = code_of(gray ^ unsure);
    if (std::abs(code - other) != 1 || std::min(code, other) >= codes) return kUnknown;
    return static_cast<double>(plan_.step) * std::max(code, other);
  }

  [[nodiscard]] static int code_of(unsigned gray) {
    for (unsigned shift = 1; shift < 32; shift *= 2) gray ^= gray >> shift;
    return static_cast<int>(gray);
  }

  [[nodiscard]] double phase_position(std::size_t pixel,
                                      PatternAxis axis,
                                      double gray,
                                      double& contrast,
                                      std::vector<std::int64_t>& sure) const {
    const std::size_t first =
        first_phase_ + (axis == PatternAxis::kColumns ? 0 : static_cast<std::size_t>(plan_.shifts));
    double cosine = 0;
    double sine = 0;
    bool saturated = false;
    for (int i = 0; i < plan_.shifts; ++i) {
      const double value = at(first + static_cast<std::size_t>(i), pixel);
      saturated = saturated || (options_.full_scale > 0 && value >= options_.full_scale);
      const double angle = 2 * std::numbers::pi * i / plan_.shifts;
      cosine += value * std::cos(angle);
      sine += value * std::sin(angle);
    }
    const double modulation = 4 * std::hypot(cosine, sine) / plan_.shifts;  // peak to peak
    const double deviation = 4 * noise_at(pixel) / std::sqrt(2.0 * plan_.shifts);
    const double lit = range(pixel);
    if (saturated || modulation <= std::max(options_.least_deviations * deviation,
                                            options_.least_contrast * lit))
      return std::numeric_limits<double>::quiet_NaN();
    for (int i = 0; i < plan_.shifts; ++i) ++sure[first + static_cast<std::size_t>(i)];
    contrast = std::min(contrast, (modulation - options_.least_deviations * deviation) / lit);
    const double part = plan_.period * std::atan2(sine, cosine) / (2 * std::numbers::pi);
    return part + plan_.period * std::round((gray - part) / plan_.period);
  }

  std::span<const GreyPicture> pictures_;
  const PatternPlan& plan_;
  const DecodingOptions& options_;
  std::size_t first_row_bit_ = 0;
  std::size_t first_phase_ = 0;
  std::vector<double> noise_levels_;  // where one bin of brightness ends and the next begins
  std::vector<double> noises_;        // one a bin
  double typical_noise_ = 0;
  std::vector<bool> lit_;
};

Status check_pictures(std::span<const GreyPicture> pictures, const PatternPlan& plan) {
  if (pictures.size() != plan.patterns.size()) {
    return fail(Errc::kInvalidOption,
                "decoding: {} pictures where the sequence has {} ({} of columns, {} of rows, white "
                "and black among them); check the projector's size and the step",
                pictures.size(),
                plan.patterns.size(),
                2 * plan.column_bits,
                2 * plan.row_bits);
  }
  const GreyPicture& first = pictures.front();
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (pictures[i].empty() || pictures[i].width() != first.width() ||
        pictures[i].height() != first.height()) {
      return fail(Errc::kInvalidOption,
                  "decoding: picture {} ({}) is {} x {} pixels and the first one {} x {}; all have "
                  "to be of one size",
                  i,
                  plan.patterns[i].name(),
                  pictures[i].width(),
                  pictures[i].height(),
                  first.width(),
                  first.height());
    }
  }
  return {};
}

}  // namespace

GreyPicture grey_of(ImageView<const Rgb16> counts) {
  GreyPicture grey(counts.width(), counts.height());
  for (int y = 0; y < counts.height(); ++y) {
    for (int x = 0; x < counts.width(); ++x) {
      const Rgb16& pixel = counts(x, y);
      grey(x, y) = static_cast<std::uint16_t>((pixel[0] + pixel[1] + pixel[2] + 1) / 3);
    }
  }
  return grey;
}

Status DecodingOptions::check() const {
  if (!(least_deviations > 0) || !std::isfinite(least_deviations) || !(least_lit >= 0) ||
      !(least_lit < 1) || !(least_contrast >= 0) || !(least_contrast < 1)) {
    return fail(Errc::kInvalidOption,
                "decoding: least_deviations is {} (above 0), least_lit {} and least_contrast {} "
                "(0 to 1)",
                least_deviations,
                least_lit,
                least_contrast);
  }
  return {};
}

Result<DecodedView> decode(std::span<const GreyPicture> pictures,
                           const PatternPlan& plan,
                           const DecodingOptions& options) {
  VENEER_TRY(options.check());
  VENEER_TRY(check_pictures(pictures, plan));
  const Sequence sequence(pictures, plan, options);
  const GreyPicture& first = pictures.front();
  DecodedView view;
  view.resolution_px = plan.shifts > 0 ? 1 : plan.step;
  view.noise_counts = sequence.noise();
  view.projector =
      Image<Eigen::Vector2f>(first.width(),
                             first.height(),
                             Eigen::Vector2f::Constant(std::numeric_limits<float>::quiet_NaN()));
  view.confidence = Image<float>(first.width(), first.height());
  view.lit = Image<std::uint8_t>(first.width(), first.height());

  std::int64_t lit = 0;
  std::int64_t decoded = 0;
  std::vector<std::int64_t> sure(pictures.size(), 0);
  for (std::size_t i = 0; i < sequence.pixels(); ++i) {
    if (!sequence.is_lit(i)) continue;
    ++lit;
    view.lit.pixels()[i] = 1;
    double contrast = 1;
    const double x = sequence.position(i, PatternAxis::kColumns, contrast, sure);
    const double y = sequence.position(i, PatternAxis::kRows, contrast, sure);
    // A sinusoid's noise may carry a position over the border of the raster, but not far.
    if (!(x > -1 && x < plan.width + 1 && y > -1 && y < plan.height + 1)) continue;
    ++decoded;
    view.projector.pixels()[i] = {static_cast<float>(x), static_cast<float>(y)};
    view.confidence.pixels()[i] = std::max(kLeastConfidence, static_cast<float>(contrast));
  }
  if (static_cast<double>(lit) < kLeastLitRatio * static_cast<double>(sequence.pixels())) {
    return fail(Errc::kBadFormat,
                "decoding: white and black pictures do not differ, so no pixel is lit by the "
                "projector; check that the pictures are in the sequence's order, that the lamp is "
                "on and that the camera sees what it lights");
  }
  view.lit_ratio = static_cast<double>(lit) / static_cast<double>(sequence.pixels());
  view.decoded_ratio = static_cast<double>(decoded) / static_cast<double>(lit);
  for (std::size_t i = 0; i < sure.size(); ++i) {
    const PatternKind kind = plan.patterns[i].kind;
    const bool bit = kind == PatternKind::kGray || kind == PatternKind::kPhase;
    view.pattern_ratio.push_back(bit ? static_cast<double>(sure[i]) / static_cast<double>(lit)
                                     : 1.0);
  }
  return view;
}

}  // namespace veneer::geometry
