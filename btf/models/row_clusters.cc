// SPDX-License-Identifier: Apache-2.0
#include "btf/models/row_clusters.h"

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "base/random.h"

namespace veneer::btf {
namespace {

// Rows that one thread works on at a time.
constexpr int kPieceRows = 256;
static_assert(kChunkRows % kPieceRows == 0);
// Lloyd's algorithm ends when an iteration gains less than this part of the error.
constexpr double kLeastGain = 1e-4;
constexpr double kFloatResolution = 1e-7;
constexpr int kStarts = 4;
constexpr int kSwaps = 96;
constexpr double kLeastKMeansGain = 1e-3;
constexpr int kMostKMeansIterations = 25;
// Steps of subspace iteration from random directions, and from those of nearly the same rows.
constexpr int kColdSteps = 4;
constexpr int kWarmSteps = 1;
// Eigenvalues under this part of the largest are rounding, not data.
constexpr double kFloatRankTolerance = 1e-6;
constexpr int kNoCluster = -1;

std::vector<std::vector<int>> members_of(const std::vector<int>& cluster, int clusters) {
  std::vector<std::vector<int>> members(static_cast<std::size_t>(clusters));
  for (std::size_t row = 0; row < cluster.size(); ++row)
    if (cluster[row] != kNoCluster)
      members[static_cast<std::size_t>(cluster[row])].push_back(static_cast<int>(row));
  return members;
}

// The number of the interval, of lengths `shares` one after the other, in which `place` lies;
// negative lengths are left out. `place` becomes the place within it.
template <class Shares>
std::size_t interval_at(const Shares& shares, std::size_t count, double& place) {
  std::size_t chosen = 0;
  double left = place;
  for (std::size_t i = 0; i < count; ++i) {
    const double share = static_cast<double>(shares(i));
    if (share < 0.0) continue;
    chosen = i;
    place = left;
    if (left <= share) break;
    left -= share;
  }
  return chosen;
}

// Gives every empty cluster the row that is reproduced worst, from a cluster that can spare it.
// `changed(k)` is told of each cluster whose rows change.
template <class Changed>
void refill_empty_clusters(std::vector<int>& cluster,
                           std::vector<double>& errors,
                           std::vector<double>& sizes,
                           Communicator& ranks,
                           Changed changed) {
  struct Worst {
    double error;
    int cluster;
  };
  for (std::size_t k = 0; k < sizes.size(); ++k) {
    if (sizes[k] > 0.0) continue;
    const auto worst =
        static_cast<std::size_t>(std::max_element(errors.begin(), errors.end()) - errors.begin());
    const Worst own =
        errors.empty() ? Worst{-1.0, kNoCluster} : Worst{errors[worst], cluster[worst]};
    const std::vector<Worst> all = gather<Worst>(ranks, {&own, 1});
    const auto taken = std::ranges::max_element(all, {}, &Worst::error);
    if (!(taken->error > 0.0)) return;
    if (taken - all.begin() == ranks.rank()) {
      cluster[worst] = static_cast<int>(k);
      errors[worst] = 0.0;
    }
    sizes[static_cast<std::size_t>(taken->cluster)] -= 1.0;
    sizes[k] = 1.0;
    changed(taken->cluster);
    changed(static_cast<int>(k));
  }
}

// k-means of all ranks' points, by Euclidean distance.
class KMeans {
 public:
  KMeans(const RowMatrix& points, int clusters, Communicator& ranks)
      : points_(points),
        clusters_(clusters),
        ranks_(ranks),
        norms_(points.rowwise().squaredNorm()) {}

  std::vector<int> run(Pcg32& random) {
    choose_centres(random);
    std::vector<int> cluster(static_cast<std::size_t>(points_.rows()));
    std::vector<double> errors(cluster.size());
    double last = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < kMostKMeansIterations; ++iteration) {
      assign(cluster, errors);
      // Error and sizes of all ranks' clusters.
      std::vector<double> totals(static_cast<std::size_t>(clusters_) + 1);
      for (std::size_t row = 0; row < cluster.size(); ++row) {
        totals[static_cast<std::size_t>(cluster[row])] += 1.0;
        totals.back() += errors[row];
      }
      ranks_.sum(totals);
      const double error = totals.back();
      totals.pop_back();
      refill_empty_clusters(cluster, errors, totals, ranks_, [](int) {});
      if (!(last - error > kLeastKMeansGain * error)) break;
      last = error;
      move_centres(cluster, totals);
    }
    return cluster;
  }

 private:
  // Arthur and Vassilvitskii 2007, "k-means++": a point becomes a centre as probably as its squared
  // distance from those before is large.
  void choose_centres(Pcg32& random) {
    centres_.resize(clusters_, points_.cols());
    const auto rows = points_.rows();
    // The first: any point.
    Eigen::VectorXf nearest = Eigen::VectorXf::Ones(rows);
    for (int k = 0; k < clusters_; ++k) {
      const double own = rows > 0 ? nearest.cast<double>().sum() : -1.0;
      const std::vector<double> totals = gather<double>(ranks_, {&own, 1});
      double sum = 0.0;
      for (const double total : totals) sum += std::max(total, 0.0);
      double place = random.uniform() * sum;
      const std::size_t owner =
          interval_at([&](std::size_t i) { return totals[i]; }, totals.size(), place);
      std::span<const float> chosen;
      if (owner == static_cast<std::size_t>(ranks_.rank())) {
        const std::size_t row =
            interval_at([&](std::size_t i) { return nearest[static_cast<Eigen::Index>(i)]; },
                        static_cast<std::size_t>(rows),
                        place);
        chosen = {points_.row(static_cast<Eigen::Index>(row)).data(),
                  static_cast<std::size_t>(points_.cols())};
      }
      const std::vector<float> centre = gather<float>(ranks_, chosen);
      centres_.row(k) = Eigen::Map<const Eigen::RowVectorXf>(centre.data(), points_.cols());
      parallel_for(rows, kPieceRows, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t row = begin; row < end; ++row) {
          const float distance = (points_.row(row) - centres_.row(k)).squaredNorm();
          nearest[row] = k == 0 ? distance : std::min(nearest[row], distance);
        }
      });
    }
  }

  void assign(std::vector<int>& cluster, std::vector<double>& errors) const {
    const Eigen::RowVectorXf halves = 0.5F * centres_.rowwise().squaredNorm().transpose();
    parallel_for(points_.rows(), kPieceRows, [&](std::int64_t begin, std::int64_t end) {
      RowMatrix products(end - begin, clusters_);
      product_transposed(
          points_.middleRows(begin, end - begin), centres_, products, Threads::kThis);
      for (std::int64_t row = begin; row < end; ++row) {
        int best = 0;
        const float score = (products.row(row - begin) - halves).maxCoeff(&best);
        cluster[static_cast<std::size_t>(row)] = best;
        errors[static_cast<std::size_t>(row)] =
            std::max(0.0, double(norms_[row]) - 2.0 * double(score));
      }
    });
  }

  void move_centres(const std::vector<int>& cluster, const std::vector<double>& sizes) {
    DoubleRowMatrix sums = DoubleRowMatrix::Zero(clusters_, points_.cols());
    const auto members = members_of(cluster, clusters_);
    parallel_for(clusters_, 1, [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t k = begin; k < end; ++k)
        for (const int row : members[static_cast<std::size_t>(k)])
          sums.row(k) += points_.row(row).cast<double>();
    });
    ranks_.sum({sums.data(), static_cast<std::size_t>(sums.size())});
    for (int k = 0; k < clusters_; ++k) {
      const double size = sizes[static_cast<std::size_t>(k)];
      centres_.row(k) = (sums.row(k) / std::max(size, 1.0)).cast<float>();
    }
  }

  const RowMatrix& points_;
  int clusters_;
  Communicator& ranks_;
  Eigen::VectorXf norms_;
  RowMatrix centres_;
};

class Lloyd {
 public:
  Lloyd(const Projection& projection,
        RowRange own,
        int clusters,
        const LocalPcaOptions& options,
        Communicator& ranks)
      : projection_(projection),
        own_(own),
        clusters_(clusters),
        options_(options),
        ranks_(ranks),
        norms_(projection.coordinates.rowwise().squaredNorm()),
        errors_(static_cast<std::size_t>(own.count)) {
    std::vector<double> energy{norms_.cast<double>().sum()};
    ranks_.sum(energy);
    energy_ = energy.front();
  }

  /// The best of several starts, which end up to a tenth apart in squared error, improved by swaps.
  RowClusters run(Progress& progress) {
    progress.start("clusters", kStarts + (clusters_ > 1 ? kSwaps : 0));
    Pcg32 random(options_.seed, 2);
    KMeans k_means(projection_.coordinates, clusters_, ranks_);
    State best;
    for (int start = 0; start < kStarts; ++start) {
      State state = cold_state(k_means.run(random));
      improve(state);
      if (start == 0 || state.error < best.error) best = std::move(state);
      progress.advance();
    }
    for (int trial = 0; trial < kSwaps && clusters_ > 1 && best.error > 0.0; ++trial) {
      State state = best;
      swap_cluster(state, random);
      state.iterations = 0;
      improve(state);
      if (state.error < best.error) {
        state.iterations += best.iterations;
        best = std::move(state);
      }
      progress.advance();
    }
    find_directions(best);
    progress.finish(fmt::format("{} iterations", best.iterations));
    return {std::move(best.cluster), std::move(best.vectors), best.iterations};
  }

 private:
  struct State {
    std::vector<int> cluster;  // [own row]; kNoCluster while a cluster is being swapped
    std::vector<std::vector<RowMatrix>> vectors;  // as RowClusters
    std::vector<RowMatrix> directions;  // [part]: [cluster * components][dimension], 0 beyond rank
    std::vector<bool> stale;            // [cluster]: its rows are not those of its directions
    std::vector<double> sizes;          // [cluster], rows of all ranks
    std::vector<double> errors;         // [cluster], squared, of all ranks, before refilling
    double error = 0.0;                 // their sum
    int iterations = 0;
  };

  State cold_state(std::vector<int> cluster) const {
    State state;
    state.cluster = std::move(cluster);
    state.stale.assign(static_cast<std::size_t>(clusters_), true);
    for (std::size_t p = 0; p < projection_.ranges.size(); ++p) {
      state.directions.emplace_back(
          RowMatrix::Zero(clusters_ * options_.components[p], projection_.ranges[p].count));
      state.vectors.emplace_back(static_cast<std::size_t>(clusters_));
    }
    return state;
  }

  // Random directions to start from; the same for every cluster.
  void make_cold(State& state, int k) const {
    for (std::size_t p = 0; p < projection_.ranges.size(); ++p) {
      const int dimension = projection_.ranges[p].count;
      RowMatrix& vectors = state.vectors[p][static_cast<std::size_t>(k)];
      vectors.resize(std::min(options_.components[p] + kOversampling, dimension), dimension);
      Pcg32 random(options_.seed, 3);
      for (float& value : vectors.reshaped()) value = static_cast<float>(random.normal());
      orthonormalise_rows(vectors);
    }
  }

  // Takes a cluster away and gives it to what is worse than the mean of another, which Lloyd's
  // algorithm, moving one row at a time, would never do. Fraenti 2018, "Efficiency of random swap
  // clustering".
  void swap_cluster(State& state, Pcg32& random) {
    find_directions(state);
    assign(state);
    double place = random.uniform() * state.error;
    const auto worst = static_cast<int>(
        interval_at([&](std::size_t k) { return state.errors[k]; }, state.errors.size(), place));
    // The smaller of two: of the little that is lost with it, more can be gained.
    const auto any = [&] { return static_cast<std::size_t>(random.uniform() * clusters_); };
    const std::size_t one = any();
    const std::size_t other = any();
    const auto removed = static_cast<int>(state.sizes[other] < state.sizes[one] ? other : one);
    const double mean = state.errors[static_cast<std::size_t>(worst)] /
                        std::max(state.sizes[static_cast<std::size_t>(worst)], 1.0);
    for (std::size_t row = 0; row < state.cluster.size(); ++row) {
      int& cluster = state.cluster[row];
      if (cluster == worst && errors_[row] >= mean)
        cluster = removed;
      else if (cluster == removed)
        cluster = kNoCluster;
    }
    make_cold(state, removed);
    iterate_vectors(state, {removed}, kColdSteps);
    assign(state);
    state.stale[static_cast<std::size_t>(worst)] = true;
    state.stale[static_cast<std::size_t>(removed)] = true;
  }

  // Alternates until nothing is gained.
  void improve(State& state) {
    double least = std::numeric_limits<double>::infinity();
    while (state.iterations < options_.iterations) {
      find_directions(state);
      assign(state);
      ++state.iterations;
      // Below float's resolution of the energies nothing is left to gain.
      if (!(least - state.error > kLeastGain * state.error) ||
          state.error <= kFloatResolution * energy_)
        break;
      least = state.error;
    }
  }

  // Only clusters whose rows changed cost anything.
  void find_directions(State& state) {
    std::vector<int> cold;
    std::vector<int> warm;
    for (int k = 0; k < clusters_; ++k) {
      if (!state.stale[static_cast<std::size_t>(k)]) continue;
      if (state.vectors.front()[static_cast<std::size_t>(k)].size() == 0) {
        make_cold(state, k);
        cold.push_back(k);
      } else {
        warm.push_back(k);
      }
    }
    iterate_vectors(state, cold, kColdSteps);
    iterate_vectors(state, warm, kWarmSteps);
    state.stale.assign(state.stale.size(), false);
  }

  // Subspace iteration for the clusters `which`, all of them with one sum over the ranks a step.
  void iterate_vectors(State& state, const std::vector<int>& which, int steps) {
    if (which.empty()) return;
    const auto members = members_of(state.cluster, clusters_);
    const std::size_t parts = projection_.ranges.size();
    const auto jobs = which.size() * parts;
    for (int step = 0; step < steps; ++step) {
      std::vector<DoubleRowMatrix> mixed(jobs);
      parallel_for(static_cast<std::int64_t>(jobs), 1, [&](std::int64_t begin, std::int64_t end) {
        for (auto job = static_cast<std::size_t>(begin); job < static_cast<std::size_t>(end); ++job)
          mixed[job] = mix(state, which[job / parts], job % parts, members);
      });
      sum_over_ranks(mixed, ranks_);
      parallel_for(static_cast<std::int64_t>(jobs), 1, [&](std::int64_t begin, std::int64_t end) {
        for (auto job = static_cast<std::size_t>(begin); job < static_cast<std::size_t>(end); ++job)
          take_step(state, which[job / parts], job % parts, mixed[job]);
      });
    }
  }

  // vectors * points^T * points, of the own rows of a cluster.
  DoubleRowMatrix mix(const State& state,
                      int k,
                      std::size_t p,
                      const std::vector<std::vector<int>>& members) const {
    const ColumnRange& range = projection_.ranges[p];
    const std::vector<int>& rows = members[static_cast<std::size_t>(k)];
    const RowMatrix& vectors = state.vectors[p][static_cast<std::size_t>(k)];
    ChunkedSum sum(vectors.rows(), vectors.cols());
    RowMatrix points(std::min<Eigen::Index>(kPieceRows, std::ssize(rows)), range.count);
    RowMatrix weights(points.rows(), vectors.rows());
    for (std::size_t i = 0; i < rows.size();) {
      const int chunk = chunk_of(rows[i]);
      Eigen::Index count = 0;
      for (; i < rows.size() && count < points.rows() && chunk_of(rows[i]) == chunk; ++i)
        points.row(count++) =
            projection_.coordinates.row(rows[i]).segment(range.first, range.count);
      product_transposed(points.topRows(count), vectors, weights.topRows(count), Threads::kThis);
      add_transposed_product(
          weights.topRows(count), points.topRows(count), sum.chunk(), Threads::kThis);
      if (i == rows.size() || chunk_of(rows[i]) != chunk) sum.end_chunk(Threads::kThis);
    }
    return std::move(sum.total());
  }

  int chunk_of(int row) const { return (own_.first + row) / kChunkRows; }

  void take_step(State& state, int k, std::size_t p, const DoubleRowMatrix& mixed) const {
    RowMatrix& vectors = state.vectors[p][static_cast<std::size_t>(k)];
    const Eigen::VectorXd values = subspace_step(vectors, mixed);
    const int count = options_.components[p];
    auto directions = state.directions[p].middleRows(k * count, count);
    directions.setZero();
    for (Eigen::Index i = 0; i < std::min<Eigen::Index>(count, values.size()); ++i) {
      if (!(values[i] > kFloatRankTolerance * values[0])) break;
      directions.row(i) = vectors.row(i);
    }
  }

  // Moves every row to the cluster that keeps most of its energy.
  void assign(State& state) {
    std::vector<int> before = state.cluster;
    parallel_for(own_.count, kPieceRows, [&](std::int64_t begin, std::int64_t end) {
      assign_rows(begin, end - begin, state);
    });
    // Of each cluster: error, rows, and rows that came or went.
    const auto count = static_cast<std::size_t>(clusters_);
    std::vector<double> totals(3 * count);
    for (std::size_t row = 0; row < before.size(); ++row) {
      const auto k = static_cast<std::size_t>(state.cluster[row]);
      totals[k] += errors_[row];
      totals[count + k] += 1.0;
      if (state.cluster[row] == before[row]) continue;
      totals[2 * count + k] += 1.0;
      if (before[row] != kNoCluster)
        totals[2 * count + static_cast<std::size_t>(before[row])] += 1.0;
    }
    ranks_.sum(totals);
    const auto first = totals.begin();
    const auto step = static_cast<std::ptrdiff_t>(count);
    state.errors.assign(first, first + step);
    state.sizes.assign(first + step, first + 2 * step);
    for (std::size_t k = 0; k < count; ++k)
      if (totals[2 * count + k] > 0.0) state.stale[k] = true;
    state.error = std::accumulate(state.errors.begin(), state.errors.end(), 0.0);
    refill_empty_clusters(state.cluster, errors_, state.sizes, ranks_, [&state](int k) {
      state.stale[static_cast<std::size_t>(k)] = true;
    });
  }

  void assign_rows(Eigen::Index first, Eigen::Index rows, State& state) {
    RowMatrix kept = RowMatrix::Zero(rows, clusters_);
    for (std::size_t p = 0; p < state.directions.size(); ++p) {
      const ColumnRange& range = projection_.ranges[p];
      const int count = options_.components[p];
      RowMatrix weights(rows, state.directions[p].rows());
      product_transposed(projection_.coordinates.block(first, range.first, rows, range.count),
                         state.directions[p],
                         weights,
                         Threads::kThis);
      for (int k = 0; k < clusters_; ++k)
        kept.col(k) += weights.middleCols(k * count, count).rowwise().squaredNorm();
    }
    for (Eigen::Index row = 0; row < rows; ++row) {
      int best = 0;
      const float energy = kept.row(row).maxCoeff(&best);
      const auto index = static_cast<std::size_t>(first + row);
      state.cluster[index] = best;
      errors_[index] = std::max(0.0, double(norms_[first + row]) - double(energy));
    }
  }

  const Projection& projection_;
  RowRange own_;
  int clusters_;
  const LocalPcaOptions& options_;
  Communicator& ranks_;
  Eigen::VectorXf norms_;       // squared, of the own rows
  double energy_ = 0.0;         // of all ranks' rows
  std::vector<double> errors_;  // squared, of each own row, after assign()
};

}  // namespace

Eigen::VectorXd subspace_step(RowMatrix& vectors, const DoubleRowMatrix& mixed) {
  const Eigen::MatrixXd product = mixed * vectors.cast<double>().transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(0.5 *
                                                              (product + product.transpose()));
  vectors = (solver.eigenvectors().rowwise().reverse().transpose() * mixed).cast<float>();
  orthonormalise_rows(vectors);
  return solver.eigenvalues().reverse();
}

RowClusters find_clusters(const Projection& projection,
                          RowRange own,
                          int clusters,
                          const LocalPcaOptions& options,
                          Communicator& ranks,
                          Progress& progress) {
  return Lloyd(projection, own, clusters, options, ranks).run(progress);
}

}  // namespace veneer::btf
