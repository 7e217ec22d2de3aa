// SPDX-License-Identifier: Apache-2.0
#include "btf/models/local_pca.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "base/random.h"
#include "base/result.h"

namespace veneer::btf {
namespace {

// Rows that are in memory at a time, as float: 40 MB of a Bonn set.
constexpr int kBlockRows = 512;
// Rows that are assigned to clusters at a time: 64 MB of weights at the most clusters and
// components, 2 MB at the usual ones.
constexpr Eigen::Index kAssignedRows = 4096;
constexpr int kPowerIterations = 2;
// Extra directions that are carried along while eigenvectors are refined, so that the last wanted
// one converges too (Halko et al. 2011, section 4.3, suggest 5 to 10).
constexpr int kOversampling = 6;
// Lloyd's algorithm ends when an iteration gains less than this part of the error.
constexpr double kLeastGain = 1e-4;
constexpr double kFloatResolution = 1e-7;
constexpr int kStarts = 4;
constexpr int kSwaps = 48;
constexpr double kLeastKMeansGain = 1e-3;
constexpr int kMostKMeansIterations = 25;
// Eigenvalues under this part of the largest are rounding, not data: of a Gram matrix in float, and
// of one in double made from float values.
constexpr float kFloatRankTolerance = 1e-6F;
constexpr double kRankTolerance = 1e-12;

// The columns [first, first + count) of each part in some matrix.
struct Range {
  int first;
  int count;
};

std::vector<Range> ranges_of(const std::vector<int>& counts) {
  std::vector<Range> ranges;
  int first = 0;
  for (const int count : counts) {
    ranges.push_back({first, count});
    first += count;
  }
  return ranges;
}

// Reads the rows `rows` into the top of `block`.
void read_rows(const RowSource& source, std::span<const int> rows, RowMatrix& block) {
  const auto columns = static_cast<std::size_t>(block.cols());
  parallel_for(
      static_cast<std::int64_t>(rows.size()), 8, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i)
          source.read(rows[static_cast<std::size_t>(i)], {block.row(i).data(), columns});
      });
}

// Calls body(block, rows) for successive blocks of the listed rows.
template <class Body>
void for_each_block(const RowSource& source,
                    std::span<const int> rows,
                    RowMatrix& block,
                    Body body) {
  for (std::size_t first = 0; first < rows.size(); first += kBlockRows) {
    const auto part = rows.subspan(first, std::min<std::size_t>(kBlockRows, rows.size() - first));
    read_rows(source, part, block);
    body(block.topRows(static_cast<Eigen::Index>(part.size())), static_cast<int>(first));
  }
}

// Replaces the rows of `rows` by orthonormal ones that span them; where they are dependent, the
// missing ones are arbitrary.
void orthonormalise_rows(RowMatrix& rows) {
  const Eigen::Map<Eigen::MatrixXf> columns(rows.data(), rows.cols(), rows.rows());
  const Eigen::HouseholderQR<Eigen::MatrixXf> qr(columns);
  const Eigen::MatrixXf q = qr.householderQ() * Eigen::MatrixXf::Identity(rows.cols(), rows.rows());
  rows = q.transpose();
}

// The data in few columns: coordinates = rows * basis^T for each part.
struct Projection {
  // Per part, [dimension][column], orthonormal rows; none where the columns are kept as they are.
  std::vector<RowMatrix> basis;
  std::vector<Range> ranges;  // of each part's coordinates
  RowMatrix coordinates;      // [row][sum of dimensions]
};

Projection keep_all_columns(const RowSource& source, std::span<const int> rows) {
  Projection projection;
  projection.ranges = ranges_of(source.part_columns);
  projection.coordinates.resize(source.rows, source.columns());
  read_rows(source, rows, projection.coordinates);
  return projection;
}

Projection project(const RowSource& source,
                   std::span<const int> rows,
                   const LocalPcaOptions& options,
                   Progress& progress) {
  const std::vector<Range> columns = ranges_of(source.part_columns);
  std::vector<int> dimensions;
  for (const Range& part : columns)
    dimensions.push_back(std::min({options.basis, part.count, source.rows}));

  Projection projection;
  projection.ranges = ranges_of(dimensions);
  const int total = std::accumulate(dimensions.begin(), dimensions.end(), 0);
  RowMatrix block(std::min(kBlockRows, source.rows), source.columns());
  progress.start("basis", static_cast<std::int64_t>(source.rows) * (kPowerIterations + 2));

  // A random mixture of the rows, then power iterations: rows <- rows * data^T * data.
  Pcg32 random(options.seed, 1);
  RowMatrix left(source.rows, total);
  for (float& value : left.reshaped()) value = static_cast<float>(random.normal());
  for (int iteration = 0; iteration <= kPowerIterations; ++iteration) {
    std::vector<RowMatrix> mixed;
    for (std::size_t p = 0; p < columns.size(); ++p)
      mixed.emplace_back(RowMatrix::Zero(dimensions[p], columns[p].count));
    for_each_block(source, rows, block, [&](const auto& data, int first) {
      for (std::size_t p = 0; p < columns.size(); ++p) {
        const auto part = data.middleCols(columns[p].first, columns[p].count);
        auto mixture =
            left.block(first, projection.ranges[p].first, data.rows(), projection.ranges[p].count);
        if (iteration > 0) product_transposed(part, projection.basis[p], mixture);
        add_transposed_product(mixture, part, mixed[p]);
      }
      progress.advance(data.rows());
    });
    for (RowMatrix& rows_of_part : mixed) orthonormalise_rows(rows_of_part);
    projection.basis = std::move(mixed);
  }

  projection.coordinates.resize(source.rows, total);
  for_each_block(source, rows, block, [&](const auto& data, int first) {
    for (std::size_t p = 0; p < columns.size(); ++p) {
      const Range& range = projection.ranges[p];
      product_transposed(
          data.middleCols(columns[p].first, columns[p].count),
          projection.basis[p],
          projection.coordinates.block(first, range.first, data.rows(), range.count));
    }
    progress.advance(data.rows());
  });
  progress.finish();
  return projection;
}

std::vector<std::vector<int>> members_of(const std::vector<int>& cluster, int clusters) {
  std::vector<std::vector<int>> members(static_cast<std::size_t>(clusters));
  for (std::size_t row = 0; row < cluster.size(); ++row)
    members[static_cast<std::size_t>(cluster[row])].push_back(static_cast<int>(row));
  return members;
}

// Gives every empty cluster the row that is reproduced worst, from a cluster that can spare it.
void refill_empty_clusters(std::vector<int>& cluster, std::vector<double>& errors, int clusters) {
  std::vector<int> sizes(static_cast<std::size_t>(clusters));
  for (const int k : cluster) ++sizes[static_cast<std::size_t>(k)];
  for (int k = 0; k < clusters; ++k) {
    if (sizes[static_cast<std::size_t>(k)] > 0) continue;
    const auto worst =
        static_cast<std::size_t>(std::max_element(errors.begin(), errors.end()) - errors.begin());
    if (!(errors[worst] > 0.0)) return;
    --sizes[static_cast<std::size_t>(cluster[worst])];
    cluster[worst] = k;
    sizes[static_cast<std::size_t>(k)] = 1;
    errors[worst] = 0.0;
  }
}

// k-means with the k-means++ start; clusters of rows by Euclidean distance.
std::vector<int> k_means(const RowMatrix& points, int clusters, Pcg32& random) {
  const auto rows = points.rows();
  const Eigen::VectorXf norms = points.rowwise().squaredNorm();
  RowMatrix centres(clusters, points.cols());
  Eigen::VectorXf nearest = Eigen::VectorXf::Constant(rows, std::numeric_limits<float>::max());
  centres.row(0) = points.row(static_cast<Eigen::Index>(random.uniform() * double(rows)));
  for (int k = 1; k < clusters; ++k) {
    const auto centre = centres.row(k - 1);
    const Eigen::VectorXf distances = (points.rowwise() - centre).rowwise().squaredNorm();
    nearest = nearest.cwiseMin(distances);
    double left = random.uniform() * nearest.cast<double>().sum();
    Eigen::Index chosen = 0;
    while (chosen + 1 < rows && (left -= double(nearest[chosen])) > 0.0) ++chosen;
    centres.row(k) = points.row(chosen);
  }

  std::vector<int> cluster(static_cast<std::size_t>(rows));
  std::vector<double> errors(static_cast<std::size_t>(rows));
  RowMatrix products(rows, clusters);
  double last = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kMostKMeansIterations; ++iteration) {
    product_transposed(points, centres, products);
    const Eigen::RowVectorXf halves = 0.5F * centres.rowwise().squaredNorm().transpose();
    double error = 0.0;
    for (Eigen::Index row = 0; row < rows; ++row) {
      int best = 0;
      const float score = (products.row(row) - halves).maxCoeff(&best);
      cluster[static_cast<std::size_t>(row)] = best;
      errors[static_cast<std::size_t>(row)] =
          std::max(0.0, double(norms[row]) - 2.0 * double(score));
      error += errors[static_cast<std::size_t>(row)];
    }
    refill_empty_clusters(cluster, errors, clusters);
    if (!(last - error > kLeastKMeansGain * error)) break;
    last = error;

    centres.setZero();
    Eigen::VectorXf sizes = Eigen::VectorXf::Zero(clusters);
    for (Eigen::Index row = 0; row < rows; ++row) {
      const int k = cluster[static_cast<std::size_t>(row)];
      centres.row(k) += points.row(row);
      sizes[k] += 1.0F;
    }
    for (int k = 0; k < clusters; ++k)
      if (sizes[k] > 0.0F) centres.row(k) /= sizes[k];
  }
  return cluster;
}

// The leading eigenvectors of points^T * points as rows, at most `count`, from the smaller of the
// two Gram matrices; those beyond the rank are zero.
RowMatrix leading_directions(const RowMatrix& points, int count) {
  RowMatrix directions = RowMatrix::Zero(count, points.cols());
  if (points.rows() == 0) return directions;
  const bool wide = points.cols() > points.rows();
  const Eigen::MatrixXf gram = wide ? Eigen::MatrixXf(points * points.transpose())
                                    : Eigen::MatrixXf(points.transpose() * points);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXf> solver(gram);
  const auto size = gram.rows();
  const float largest = solver.eigenvalues()[size - 1];
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(count, size); ++i) {
    const auto vector = solver.eigenvectors().col(size - 1 - i);
    if (!(solver.eigenvalues()[size - 1 - i] > kFloatRankTolerance * largest)) break;
    if (wide)
      directions.row(i) = (vector.transpose() * points).normalized();
    else
      directions.row(i) = vector.transpose();
  }
  return directions;
}

// Clusters in the coordinates of a projection, each part with its own leading directions.
class Lloyd {
 public:
  Lloyd(const Projection& projection, const LocalPcaOptions& options, int clusters)
      : projection_(projection), options_(options), clusters_(clusters) {
    for (std::size_t p = 0; p < projection.ranges.size(); ++p)
      directions_.emplace_back(
          RowMatrix::Zero(clusters * options.components[p], projection.ranges[p].count));
    norms_ = projection.coordinates.rowwise().squaredNorm();
    members_.resize(static_cast<std::size_t>(clusters));
    errors_.resize(static_cast<std::size_t>(norms_.size()));
  }

  /// The best of several starts, which end up to a tenth apart in squared error, improved by swaps.
  std::vector<int> run(Progress& progress, int& iterations) {
    progress.start("clusters", kStarts + (clusters_ > 1 ? kSwaps : 0));
    Pcg32 random(options_.seed, 2);
    std::vector<int> best;
    double least = std::numeric_limits<double>::infinity();
    for (int start = 0; start < kStarts; ++start) {
      std::vector<int> cluster = k_means(projection_.coordinates, clusters_, random);
      int done = 0;
      const double error = improve(cluster, done);
      if (error < least) {
        least = error;
        best = std::move(cluster);
        iterations = done;
      }
      progress.advance();
    }
    for (int trial = 0; trial < kSwaps && clusters_ > 1 && least > 0.0; ++trial) {
      std::vector<int> cluster = best;
      int done = 0;
      swap_cluster(cluster, random);
      const double error = improve(cluster, done);
      if (error < least) {
        least = error;
        best = std::move(cluster);
        iterations += done;
      }
      progress.advance();
    }
    progress.finish(fmt::format("{} iterations", iterations));
    return best;
  }

 private:
  // Takes a cluster away and gives it to the worse half of another, which Lloyd's algorithm, moving
  // one row at a time, would never do. Fraenti 2018, "Efficiency of random swap clustering".
  void swap_cluster(std::vector<int>& cluster, Pcg32& random) {
    find_directions(cluster);
    assign(cluster);
    const auto pick = [&random](double total, const auto& share, std::size_t count) {
      double left = random.uniform() * total;
      std::size_t chosen = 0;
      while (chosen + 1 < count && (left -= share(chosen)) > 0.0) ++chosen;
      return chosen;
    };
    const double total = std::accumulate(errors_.begin(), errors_.end(), 0.0);
    const auto worst = cluster[pick(
        total, [&](std::size_t row) { return errors_[row]; }, errors_.size())];
    const auto removed = static_cast<int>(random.uniform() * clusters_);
    std::vector<int> rows;
    for (std::size_t row = 0; row < cluster.size(); ++row)
      if (cluster[row] == worst) rows.push_back(static_cast<int>(row));
    std::ranges::sort(rows, [this](int a, int b) {
      return errors_[static_cast<std::size_t>(a)] > errors_[static_cast<std::size_t>(b)];
    });
    rows.resize((rows.size() + 1) / 2);
    find_directions_of(removed, rows);
    members_[static_cast<std::size_t>(removed)] = rows;
    assign(cluster);
  }

  // Alternates until nothing is gained; leaves the best clusters seen, returns their squared error.
  double improve(std::vector<int>& best, int& iterations) {
    std::vector<int> cluster = best;
    double least = std::numeric_limits<double>::infinity();
    const double energy = norms_.cast<double>().sum();
    while (iterations < options_.iterations) {
      find_directions(cluster);
      const double error = assign(cluster);
      ++iterations;
      const bool gained = least - error > kLeastGain * error;
      if (error < least) {
        least = error;
        best = cluster;
      }
      // Below float's resolution of the energies nothing is left to gain.
      if (!gained || error <= kFloatResolution * energy) break;
    }
    return least;
  }

  // Only clusters whose rows changed cost anything.
  void find_directions(const std::vector<int>& cluster) {
    auto members = members_of(cluster, clusters_);
    parallel_for(clusters_, 1, [&](std::int64_t begin, std::int64_t end) {
      for (auto k = static_cast<int>(begin); k < end; ++k) {
        const std::vector<int>& rows = members[static_cast<std::size_t>(k)];
        if (rows != members_[static_cast<std::size_t>(k)]) find_directions_of(k, rows);
      }
    });
    members_ = std::move(members);
  }

  void find_directions_of(int k, const std::vector<int>& rows) {
    for (std::size_t p = 0; p < directions_.size(); ++p) {
      const Range& range = projection_.ranges[p];
      RowMatrix points(static_cast<Eigen::Index>(rows.size()), range.count);
      for (std::size_t i = 0; i < rows.size(); ++i)
        points.row(static_cast<Eigen::Index>(i)) =
            projection_.coordinates.row(rows[i]).segment(range.first, range.count);
      const int count = options_.components[p];
      directions_[p].middleRows(k * count, count) = leading_directions(points, count);
    }
  }

  // Moves every row to the cluster that keeps most of its energy; returns the squared error.
  double assign(std::vector<int>& cluster) {
    const auto rows = projection_.coordinates.rows();
    for (Eigen::Index first = 0; first < rows; first += kAssignedRows)
      assign_rows(first, std::min<Eigen::Index>(kAssignedRows, rows - first), cluster);
    const double error = std::accumulate(errors_.begin(), errors_.end(), 0.0);
    refill_empty_clusters(cluster, errors_, clusters_);
    return error;
  }

  void assign_rows(Eigen::Index first, Eigen::Index rows, std::vector<int>& cluster) {
    RowMatrix kept = RowMatrix::Zero(rows, clusters_);
    for (std::size_t p = 0; p < directions_.size(); ++p) {
      const Range& range = projection_.ranges[p];
      const int count = options_.components[p];
      RowMatrix weights(rows, directions_[p].rows());
      product_transposed(projection_.coordinates.block(first, range.first, rows, range.count),
                         directions_[p],
                         weights);
      for (int k = 0; k < clusters_; ++k)
        kept.col(k) += weights.middleCols(k * count, count).rowwise().squaredNorm();
    }
    for (Eigen::Index row = 0; row < rows; ++row) {
      int best = 0;
      const float energy = kept.row(row).maxCoeff(&best);
      const auto index = static_cast<std::size_t>(first + row);
      cluster[index] = best;
      errors_[index] = std::max(0.0, double(norms_[first + row]) - double(energy));
    }
  }

  const Projection& projection_;
  const LocalPcaOptions& options_;
  int clusters_;
  std::vector<RowMatrix> directions_;      // per part, [cluster * components][dimension]
  std::vector<std::vector<int>> members_;  // the rows that each cluster's directions are of
  Eigen::VectorXf norms_;
  std::vector<double> errors_;  // squared, of each row, after assign()
};

// One part of one cluster while its eigenvectors are refined in the full space.
struct Refinement {
  RowMatrix vectors;  // [carried][column], orthonormal
  RowMatrix weights;  // [member][carried]
};

}  // namespace

int RowSource::columns() const {
  return std::accumulate(part_columns.begin(), part_columns.end(), 0);
}

LocalPca fit_local_pca(const RowSource& source,
                       const LocalPcaOptions& options,
                       Progress& progress) {
  VENEER_CHECK(source.rows > 0 && options.clusters >= 1 && options.clusters <= 256);
  VENEER_CHECK(source.part_columns.size() == options.components.size());
  VENEER_CHECK(std::ranges::all_of(options.components, [](int count) { return count >= 1; }));

  std::vector<int> rows(static_cast<std::size_t>(source.rows));
  std::iota(rows.begin(), rows.end(), 0);
  const Projection projection = options.basis == 0 ? keep_all_columns(source, rows)
                                                   : project(source, rows, options, progress);
  LocalPca pca;
  pca.clusters = std::min(options.clusters, source.rows);
  const std::vector<int> cluster =
      Lloyd(projection, options, pca.clusters).run(progress, pca.iterations);
  pca.cluster.assign(cluster.begin(), cluster.end());

  const std::vector<Range> columns = ranges_of(source.part_columns);
  const std::vector<Range> components = ranges_of(options.components);
  pca.weights = RowMatrix::Zero(source.rows, components.back().first + components.back().count);
  for (std::size_t p = 0; p < columns.size(); ++p)
    pca.eigenvectors.emplace_back(
        RowMatrix::Zero(pca.clusters * components[p].count, columns[p].count));

  progress.start("eigenvectors", static_cast<std::int64_t>(source.rows) * (kPowerIterations + 1));
  RowMatrix block(std::min(kBlockRows, source.rows), source.columns());
  double energy = 0.0;
  double explained = 0.0;
  const auto members = members_of(cluster, pca.clusters);
  for (int k = 0; k < pca.clusters; ++k) {
    const std::vector<int>& in_cluster = members[static_cast<std::size_t>(k)];
    if (in_cluster.empty()) continue;
    const auto size = static_cast<int>(in_cluster.size());

    // Start from the leading directions in the basis, taken to the full space.
    std::vector<Refinement> parts(columns.size());
    for (std::size_t p = 0; p < columns.size(); ++p) {
      const Range& range = projection.ranges[p];
      RowMatrix points(size, range.count);
      for (int i = 0; i < size; ++i)
        points.row(i) = projection.coordinates.row(in_cluster[static_cast<std::size_t>(i)])
                            .segment(range.first, range.count);
      const int carried = std::min({components[p].count + kOversampling, size, range.count});
      parts[p].vectors.resize(carried, columns[p].count);
      if (projection.basis.empty())
        parts[p].vectors = leading_directions(points, carried);
      else
        product(leading_directions(points, carried), projection.basis[p], parts[p].vectors);
      parts[p].weights.resize(size, carried);
    }

    // Power iterations with the true data; the last round only projects.
    for (int iteration = 0; iteration <= kPowerIterations; ++iteration) {
      std::vector<RowMatrix> mixed;
      for (Refinement& part : parts) {
        orthonormalise_rows(part.vectors);
        mixed.emplace_back(RowMatrix::Zero(part.vectors.rows(), part.vectors.cols()));
      }
      const bool last = iteration == kPowerIterations;
      for_each_block(source, in_cluster, block, [&](const auto& data, int first) {
        for (std::size_t p = 0; p < columns.size(); ++p) {
          const auto part = data.middleCols(columns[p].first, columns[p].count);
          auto weights = parts[p].weights.middleRows(first, data.rows());
          product_transposed(part, parts[p].vectors, weights);
          if (last)
            energy += part.rowwise().squaredNorm().template cast<double>().sum();
          else
            add_transposed_product(weights, part, mixed[p]);
        }
        progress.advance(data.rows());
      });
      for (std::size_t p = 0; p < columns.size() && !last; ++p)
        parts[p].vectors = std::move(mixed[p]);
    }

    // Within what is carried, the best directions come from the small Gram matrix of the weights.
    for (std::size_t p = 0; p < columns.size(); ++p) {
      const Eigen::MatrixXd weights = parts[p].weights.cast<double>();
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(weights.transpose() * weights);
      const auto carried = weights.cols();
      const double largest = solver.eigenvalues()[carried - 1];
      for (int j = 0; j < std::min<int>(components[p].count, static_cast<int>(carried)); ++j) {
        const double value = solver.eigenvalues()[carried - 1 - j];
        if (!(value > kRankTolerance * largest)) break;
        explained += value;
        const Eigen::VectorXd mix = solver.eigenvectors().col(carried - 1 - j);
        pca.eigenvectors[p].row(k * components[p].count + j) =
            mix.cast<float>().transpose() * parts[p].vectors;
        const Eigen::VectorXd rotated = weights * mix;
        for (int i = 0; i < size; ++i)
          pca.weights(in_cluster[static_cast<std::size_t>(i)], components[p].first + j) =
              static_cast<float>(rotated[i]);
      }
    }
  }
  pca.unexplained = energy > 0.0 ? std::max(0.0, 1.0 - explained / energy) : 0.0;
  progress.finish(fmt::format("{:.3g} % of the energy unexplained", 100.0 * pca.unexplained));
  return pca;
}

}  // namespace veneer::btf
