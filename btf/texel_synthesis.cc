// SPDX-License-Identifier: Apache-2.0
#include "btf/texel_synthesis.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"

namespace veneer::btf {
namespace {

constexpr int kPairs = 12;
// Views and lights nearer to the horizon, where few materials are measured well, only where there
// are no others. cos(66 degrees)
constexpr double kLeastCosine = 0.4;
// How much worse than the best a patch may fit, its distances (Efros and Freeman 2001,
// section 2.1).
constexpr float kTolerance = 0.1F;

struct Pair {
  Direction view;
  Direction light;
  [[nodiscard]] double distance(const Pair& other) const {
    return (view - other.view).squaredNorm() + (light - other.light).squaredNorm();
  }
};

// Beginning at the steepest, each time the one furthest from all before.
std::vector<Pair> spread_pairs(const Material& material) {
  std::vector<Pair> all;
  for (const double least : {kLeastCosine, -1.0}) {
    for (const Direction& view : material.views())
      for (const Direction& light : material.lights())
        if (view.z() >= least && light.z() >= least) all.push_back({view, light});
    if (!all.empty()) break;
  }
  std::vector<double> apart(all.size(), std::numeric_limits<double>::infinity());
  std::vector<Pair> chosen;
  auto next = std::ranges::max_element(
      all, {}, [](const Pair& p) { return std::min(p.view.z(), p.light.z()); });
  while (chosen.size() < std::min<std::size_t>(kPairs, all.size())) {
    chosen.push_back(*next);
    for (std::size_t i = 0; i < all.size(); ++i)
      apart[i] = std::min(apart[i], all[i].distance(chosen.back()));
    next = all.begin() + (std::ranges::max_element(apart) - apart.begin());
  }
  return chosen;
}

int wrapped(int value, int size) {
  const int rest = value % size;
  return rest < 0 ? rest + size : rest;
}

// Where patches begin along one side: evenly, no further apart than they may be.
std::vector<int> places(int side, int step) {
  // Two at least: one alone would end where the sample ends.
  const int count = std::max((side + step - 1) / step, 2);
  std::vector<int> result;
  for (std::int64_t i = 0; i < count; ++i) result.push_back(static_cast<int>(i * side / count));
  return result;
}

// The cheapest way through `cost` from the first row to the last, a column at most aside for each
// row (Efros and Freeman 2001, section 2.2): the column of each row.
std::vector<int> cheapest_cut(const Eigen::MatrixXf& cost) {
  Eigen::MatrixXf sum = cost;
  const Eigen::Index rows = cost.rows();
  const Eigen::Index columns = cost.cols();
  const auto best_above = [&](Eigen::Index row, Eigen::Index column) {
    Eigen::Index best = std::max<Eigen::Index>(column - 1, 0);
    for (Eigen::Index c = best + 1; c <= std::min(column + 1, columns - 1); ++c)
      if (sum(row - 1, c) < sum(row - 1, best)) best = c;
    return best;
  };
  for (Eigen::Index r = 1; r < rows; ++r)
    for (Eigen::Index c = 0; c < columns; ++c) sum(r, c) += sum(r - 1, best_above(r, c));
  std::vector<int> cut(static_cast<std::size_t>(rows));
  Eigen::Index column = 0;
  sum.row(rows - 1).minCoeff(&column);
  for (Eigen::Index r = rows - 1; r >= 0; --r) {
    cut[static_cast<std::size_t>(r)] = static_cast<int>(column);
    if (r > 0) column = best_above(r, column);
  }
  return cut;
}

// By how much a patch lies over what is there along each of its sides, texels; 0: nothing is.
struct Overlaps {
  int left = 0;
  int right = 0;
  int top = 0;
  int bottom = 0;
};

class Quilt {
 public:
  Quilt(const TexelFeatures& features, const SynthesisOptions& options)
      : features_(features),
        options_(options),
        columns_(places(options.width, options.patch - options.overlap)),
        rows_(places(options.height, options.patch - options.overlap)),
        random_(options.seed),
        sources_(static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height),
                 kNone) {}

  [[nodiscard]] std::int64_t patch_count() const {
    return static_cast<std::int64_t>(columns_.size() * rows_.size());
  }
  // Patches go from left to right and from top to bottom.
  void add(std::int64_t number) {
    const auto count = static_cast<std::int64_t>(columns_.size());
    const auto column = static_cast<std::size_t>(number % count);
    const auto row = static_cast<std::size_t>(number / count);
    const Origin at{columns_[column], rows_[row]};
    const Origin from = choose(at);
    lay(at, from, overlaps(column, row));
    laid_.push_back({at, from});
  }
  [[nodiscard]] std::vector<TexelMap::Source> sources() const {
    std::vector<TexelMap::Source> result;
    result.reserve(sources_.size());
    for (const int texel : sources_)
      result.push_back({static_cast<std::uint16_t>(texel % features_.width),
                        static_cast<std::uint16_t>(texel / features_.width)});
    return result;
  }

 private:
  static constexpr int kNone = -1;
  struct Origin {
    int x = 0;
    int y = 0;
  };
  struct Laid {
    Origin at;    // in the map
    Origin from;  // in the sample
  };
  // A place that a new patch lies over: where in the patch, and what it shows.
  struct Covered {
    int x;
    int y;
    int texel;
  };

  [[nodiscard]] std::size_t place(const Origin& at, int x, int y) const {
    return static_cast<std::size_t>(wrapped(at.y + y, options_.height)) *
               static_cast<std::size_t>(options_.width) +
           static_cast<std::size_t>(wrapped(at.x + x, options_.width));
  }
  [[nodiscard]] int texel(const Origin& from, int x, int y) const {
    return wrapped(from.y + y, features_.height) * features_.width +
           wrapped(from.x + x, features_.width);
  }
  [[nodiscard]] float difference(int a, int b) const {
    return (features_.values.col(a) - features_.values.col(b)).squaredNorm();
  }
  // Origins that a patch may have along a side of the sample.
  [[nodiscard]] int origins(int side) const {
    return options_.source_wraps ? side : side - options_.patch + 1;
  }

  [[nodiscard]] Overlaps overlaps(std::size_t column, std::size_t row) const {
    const auto gap = [](const std::vector<int>& all, std::size_t i, int side) {
      return i + 1 < all.size() ? all[i + 1] - all[i] : side - all[i] + all[0];
    };
    const auto over = [&](int distance) { return std::max(options_.patch - distance, 0); };
    Overlaps result;
    if (column > 0) result.left = over(gap(columns_, column - 1, options_.width));
    if (row > 0) result.top = over(gap(rows_, row - 1, options_.height));
    if (column + 1 == columns_.size()) result.right = over(gap(columns_, column, options_.width));
    if (row + 1 == rows_.size()) result.bottom = over(gap(rows_, row, options_.height));
    return result;
  }

  [[nodiscard]] Origin choose(const Origin& at) {
    const int across = origins(features_.width);
    const std::vector<float> costs = costs_of(at);
    std::vector<std::uint8_t> stale = stale_origins(at);
    float best = std::numeric_limits<float>::infinity();
    const auto look = [&] {
      for (std::size_t i = 0; i < costs.size(); ++i)
        if (stale[i] == 0) best = std::min(best, costs[i]);
    };
    look();
    if (!std::isfinite(best)) {
      std::ranges::fill(stale, 0);
      look();
    }
    const float most = best * (1.0F + kTolerance) * (1.0F + kTolerance);
    std::vector<int> good;
    for (std::size_t i = 0; i < costs.size(); ++i)
      if (stale[i] == 0 && costs[i] <= most) good.push_back(static_cast<int>(i));
    const int chosen =
        good[static_cast<std::size_t>(random_.uniform() * static_cast<double>(good.size()))];
    return {chosen % across, chosen / across};
  }

  // How far each patch of the sample is from what it would lie over.
  [[nodiscard]] std::vector<float> costs_of(const Origin& at) const {
    std::vector<Covered> covered;
    for (int y = 0; y < options_.patch; ++y)
      for (int x = 0; x < options_.patch; ++x)
        if (const int shown = sources_[place(at, x, y)]; shown != kNone)
          covered.push_back({x, y, shown});
    const int across = origins(features_.width);
    const int down = origins(features_.height);
    std::vector<float> costs(static_cast<std::size_t>(across) * static_cast<std::size_t>(down));
    parallel_for(down, 4, [&](std::int64_t begin, std::int64_t end) {
      for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
        for (int x = 0; x < across; ++x) {
          float sum = 0.0F;
          for (const Covered& c : covered) sum += difference(c.texel, texel({x, y}, c.x, c.y));
          costs[static_cast<std::size_t>(y) * static_cast<std::size_t>(across) +
                static_cast<std::size_t>(x)] = sum;
        }
    });
    return costs;
  }

  // Origins that would go on with the piece of the sample that a patch beside shows, which fits
  // without fail and lays the sample out as tiles do; or show again, a quarter of a patch off at
  // most, what is shown two patches away or nearer.
  [[nodiscard]] std::vector<std::uint8_t> stale_origins(const Origin& at) const {
    const int across = origins(features_.width);
    const int down = origins(features_.height);
    std::vector<std::uint8_t> stale(static_cast<std::size_t>(across) *
                                    static_cast<std::size_t>(down));
    const auto mark = [&](const Origin& middle, int reach) {
      for (int y = middle.y - reach; y <= middle.y + reach; ++y)
        for (int x = middle.x - reach; x <= middle.x + reach; ++x) {
          Origin o{x, y};
          if (options_.source_wraps) o = {wrapped(x, across), wrapped(y, down)};
          if (o.x < 0 || o.y < 0 || o.x >= across || o.y >= down) continue;
          stale[static_cast<std::size_t>(o.y) * static_cast<std::size_t>(across) +
                static_cast<std::size_t>(o.x)] = 1;
        }
    };
    const auto nearest = [](int distance, int side) {
      const int rest = wrapped(distance, side);
      return rest <= side - rest ? rest : rest - side;
    };
    for (const Laid& laid : laid_) {
      const int x = nearest(at.x - laid.at.x, options_.width);
      const int y = nearest(at.y - laid.at.y, options_.height);
      if (std::abs(x) <= 2 * options_.patch && std::abs(y) <= 2 * options_.patch)
        mark(laid.from, options_.patch / 4);
      if (std::abs(x) <= options_.patch && std::abs(y) <= options_.patch)
        mark({laid.from.x + x, laid.from.y + y}, options_.overlap);
    }
    return stale;
  }

  // Which texels of a patch are laid: those within the cheapest cuts through what it lies over.
  void lay(const Origin& at, const Origin& from, const Overlaps& over) {
    const int side = options_.patch;
    Eigen::MatrixXf cost = Eigen::MatrixXf::Zero(side, side);  // [y][x]
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x)
        if (const int shown = sources_[place(at, x, y)]; shown != kNone)
          cost(y, x) = difference(shown, texel(from, x, y));
    std::vector<int> left(static_cast<std::size_t>(side), 0);
    std::vector<int> right(left.size(), side - 1);
    std::vector<int> top(left.size(), 0);
    std::vector<int> bottom(left.size(), side - 1);
    const auto shift = [side](std::vector<int> cut, int width) {
      for (int& c : cut) c += side - width;
      return cut;
    };
    if (over.left > 0) left = cheapest_cut(cost.leftCols(over.left));
    if (over.right > 0) right = shift(cheapest_cut(cost.rightCols(over.right)), over.right);
    if (over.top > 0) top = cheapest_cut(cost.topRows(over.top).transpose());
    if (over.bottom > 0)
      bottom = shift(cheapest_cut(cost.bottomRows(over.bottom).transpose()), over.bottom);
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        const auto row = static_cast<std::size_t>(y);
        const auto column = static_cast<std::size_t>(x);
        int& shown = sources_[place(at, x, y)];
        const bool is_within =
            x >= left[row] && x <= right[row] && y >= top[column] && y <= bottom[column];
        if (is_within || shown == kNone) shown = texel(from, x, y);
      }
  }

  const TexelFeatures& features_;
  const SynthesisOptions& options_;
  std::vector<int> columns_;
  std::vector<int> rows_;
  Pcg32 random_;
  std::vector<int> sources_;  // texels of the sample, or kNone
  std::vector<Laid> laid_;
};

using Vector = Eigen::Matrix<double, TexelFeatures::kCount, 1>;

// Of the map's features with themselves, so far aside and down.
double correlation(const TexelMap& map, const TexelFeatures& features, int aside, int down) {
  const auto feature = [&](int x, int y) {
    const int place = wrapped(y, map.height()) * map.width() + wrapped(x, map.width());
    return Vector(features.values.col(map.source_texel(place)).cast<double>());
  };
  Vector mean = Vector::Zero();
  for (int place = 0; place < map.place_count(); ++place)
    mean += features.values.col(map.source_texel(place)).cast<double>();
  mean /= map.place_count();
  double together = 0.0;
  double alone = 0.0;
  for (int y = 0; y < map.height(); ++y)
    for (int x = 0; x < map.width(); ++x) {
      const Vector here = feature(x, y) - mean;
      together += here.dot(feature(x + aside, y + down) - mean);
      alone += here.squaredNorm();
    }
  return alone > 0.0 ? together / alone : 0.0;
}

struct Mean {
  double sum = 0.0;
  std::int64_t count = 0;
  void add(double value) {
    sum += value;
    ++count;
  }
  [[nodiscard]] double value() const { return count > 0 ? sum / static_cast<double>(count) : 0.0; }
};

}  // namespace

TexelFeatures texel_features(const Material& material) {
  const std::vector<Pair> pairs = spread_pairs(material);
  const int texels = material.width() * material.height();
  const auto values = static_cast<Eigen::Index>(3 * pairs.size());
  Eigen::MatrixXd sent(values, texels);
  parallel_for(texels, 64, [&](std::int64_t begin, std::int64_t end) {
    for (auto texel = static_cast<int>(begin); texel < static_cast<int>(end); ++texel)
      for (std::size_t i = 0; i < pairs.size(); ++i)
        sent.block<3, 1>(static_cast<Eigen::Index>(3 * i), texel) =
            material.radiance(texel, pairs[i].view, pairs[i].light).cwiseMax(0.0).cwiseSqrt();
  });
  sent.colwise() -= sent.rowwise().mean().eval();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(sent * sent.transpose());
  const Eigen::Index kept = std::min<Eigen::Index>(TexelFeatures::kCount, values);
  TexelFeatures features{material.width(),
                         material.height(),
                         TexelFeatures::Values::Zero(TexelFeatures::kCount, texels)};
  features.values.topRows(kept) =
      (solver.eigenvectors().rightCols(kept).transpose() * sent).cast<float>();
  return features;
}

Status SynthesisOptions::check(int sample_width, int sample_height) const {
  constexpr std::string_view kDoing = "expanding";
  const auto check_side = [&](std::string_view name, int value, int sample) -> Status {
    if (value >= sample && value <= TexelMap::kMostSide) return {};
    return fail(Errc::kInvalidOption,
                "{}: the {} is {} texels; it must be {}, which the sample has, to {}",
                kDoing,
                name,
                value,
                sample,
                TexelMap::kMostSide);
  };
  VENEER_TRY(check_side("width", width, sample_width));
  VENEER_TRY(check_side("height", height, sample_height));
  if (const int most = std::min(sample_width, sample_height); patch < 2 || patch > most)
    return fail(Errc::kInvalidOption,
                "{}: a patch of {} texels a side; it must have 2 to {}, and fit into the sample of "
                "{} x {} texels",
                kDoing,
                patch,
                most,
                sample_width,
                sample_height);
  if (overlap < 1 || overlap > patch / 2)
    return fail(Errc::kInvalidOption,
                "{}: an overlap of {} texels; it must be 1 to {}, half a patch",
                kDoing,
                overlap,
                patch / 2);
  return {};
}

Result<TexelMap> synthesize_texels(const TexelFeatures& features,
                                   const SynthesisOptions& options,
                                   Progress& progress) {
  VENEER_TRY(options.check(features.width, features.height));
  for (Eigen::Index texel = 0; texel < features.values.cols(); ++texel) {
    if (features.values.col(texel).allFinite()) continue;
    return fail(
        Errc::kBadFormat,
        "laying patches of a sample: its texel {} sends light that is no finite number, so that "
        "the material's file is damaged; fit it again",
        texel);
  }
  Quilt quilt(features, options);
  progress.start("laying patches", quilt.patch_count());
  for (std::int64_t i = 0; i < quilt.patch_count(); ++i) {
    quilt.add(i);
    progress.advance();
  }
  progress.finish();
  return TexelMap::create(
      options.width, options.height, quilt.sources(), features.width, features.height);
}

MapQuality quality_of(const TexelMap& map, const TexelFeatures& features) {
  const int width = features.width;
  const int height = features.height;
  const auto step = [&](int a, int b) {
    return static_cast<double>((features.values.col(a) - features.values.col(b)).norm());
  };
  Mean within;
  Mean tiling;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const int here = y * width + x;
      (x + 1 < width ? within : tiling).add(step(here, y * width + (x + 1) % width));
      (y + 1 < height ? within : tiling).add(step(here, (y + 1) % height * width + x));
    }
  Mean seam;
  std::vector<std::uint8_t> is_used(static_cast<std::size_t>(width * height));
  for (int y = 0; y < map.height(); ++y)
    for (int x = 0; x < map.width(); ++x) {
      const int here = map.source_texel(y * map.width() + x);
      is_used[static_cast<std::size_t>(here)] = 1;
      const int beside = map.source_texel(y * map.width() + (x + 1) % map.width());
      const int below = map.source_texel((y + 1) % map.height() * map.width() + x);
      // The last of a row is followed by the next row's first, which is no neighbour.
      if (beside != here + 1 || here % width == width - 1) seam.add(step(here, beside));
      if (below != here + width) seam.add(step(here, below));
    }
  MapQuality quality;
  const double unit = within.value();
  if (unit > 0.0) {
    quality.seam_step = seam.value() / unit;
    quality.tiling_step = tiling.value() / unit;
  }
  quality.repetition =
      std::max(correlation(map, features, width, 0), correlation(map, features, 0, height));
  quality.texels_used =
      static_cast<double>(std::ranges::count(is_used, 1)) / static_cast<double>(width * height);
  return quality;
}

}  // namespace veneer::btf
