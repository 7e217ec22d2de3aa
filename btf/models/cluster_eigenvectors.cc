// SPDX-License-Identifier: Apache-2.0
#include "btf/models/cluster_eigenvectors.h"

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "base/parallel.h"

namespace veneer::btf {
namespace {

constexpr int kPowerIterations = 2;
// Eigenvalues under this part of the largest are rounding, not data: of a Gram matrix in double
// made from float values.
constexpr double kRankTolerance = 1e-12;

// One part of one cluster while its eigenvectors are refined.
struct Refinement {
  int cluster = 0;
  std::size_t part = 0;
  RowMatrix vectors;  // [carried][column], orthonormal
  RowMatrix weights;  // [own row of the cluster][carried]
};

class EigenvectorFit {
 public:
  EigenvectorFit(const RowSource& source,
                 std::span<const int> rows,
                 const Projection& projection,
                 const RowClusters& clusters,
                 const LocalPcaOptions& options,
                 Communicator& ranks,
                 Progress& progress,
                 LocalPca& pca)
      : source_(source),
        projection_(projection),
        clusters_(clusters),
        ranks_(ranks),
        progress_(progress),
        pca_(pca),
        columns_(ranges_of(source.part_columns)),
        components_(ranges_of(options.components)),
        block_(std::min(kBlockRows, source.rows), source.columns()),
        members_(static_cast<std::size_t>(pca.clusters)) {
    for (std::size_t i = 0; i < rows.size(); ++i)
      members_[static_cast<std::size_t>(clusters.cluster[i])].push_back(rows[i]);
  }

  void run() {
    progress_.start("eigenvectors",
                    std::ssize(clusters_.cluster) * std::int64_t{kPowerIterations + 1});
    double carried_columns = 0.0;
    for (std::size_t p = 0; p < columns_.size(); ++p)
      carried_columns += double(clusters_.vectors[p].front().rows()) * columns_[p].count;
    const double bytes = carried_columns * (sizeof(float) + sizeof(float) + sizeof(double));
    const int group = std::max(1, static_cast<int>(std::min(kGroupBytes / bytes, 256.0)));
    for (int first = 0; first < pca_.clusters; first += group)
      refine(first, std::min(group, pca_.clusters - first));
    std::vector<double> energy{energy_};
    ranks_.sum(energy);
    pca_.unexplained =
        energy.front() > 0.0 ? std::max(0.0, 1.0 - explained_ / energy.front()) : 0.0;
    progress_.finish(fmt::format("{:.3g} % of the energy unexplained", 100.0 * pca_.unexplained));
  }

 private:
  // The clusters [first, first + count): power iterations with the true data, and projection.
  void refine(int first, int count) {
    std::vector<Refinement> group = start(first, count);
    const auto for_all = [&group](const auto& body) {
      parallel_for(std::ssize(group), 1, [&](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
          body(i);
      });
    };
    for (int iteration = 0; iteration < kPowerIterations; ++iteration) {
      std::vector<DoubleRowMatrix> mixed = mix(group);
      sum_over_ranks(mixed, ranks_);
      for_all([&](std::size_t i) { subspace_step(group[i].vectors, mixed[i]); });
    }
    std::vector<DoubleRowMatrix> grams = project(group);
    sum_over_ranks(grams, ranks_);
    for (std::size_t i = 0; i < group.size(); ++i) finish(group[i], grams[i]);
  }

  // The leading directions in the basis, taken to the full space.
  std::vector<Refinement> start(int first, int count) const {
    std::vector<Refinement> group;
    for (int k = first; k < first + count; ++k) {
      const auto members = std::ssize(members_[static_cast<std::size_t>(k)]);
      for (std::size_t p = 0; p < columns_.size(); ++p) {
        const RowMatrix& vectors = clusters_.vectors[p][static_cast<std::size_t>(k)];
        Refinement part;
        part.cluster = k;
        part.part = p;
        if (projection_.basis.empty()) {
          part.vectors = vectors;
        } else {
          part.vectors.resize(vectors.rows(), columns_[p].count);
          product(vectors, projection_.basis[p], part.vectors);
        }
        part.weights.resize(members, vectors.rows());
        group.push_back(std::move(part));
      }
    }
    return group;
  }

  // Calls body(block, first, i) for the own rows of each cluster of the group, `i` the place of its
  // first part in the group.
  template <class Body>
  void for_each_member(const std::vector<Refinement>& group, Body body) {
    for (std::size_t i = 0; i < group.size(); i += columns_.size())
      for_each_block(source_,
                     members_[static_cast<std::size_t>(group[i].cluster)],
                     block_,
                     [&](const auto& data, int first) {
                       body(data, first, i);
                       progress_.advance(data.rows());
                     });
  }

  std::vector<DoubleRowMatrix> mix(std::vector<Refinement>& group) {
    std::vector<DoubleRowMatrix> mixed;
    for (const Refinement& part : group)
      mixed.emplace_back(DoubleRowMatrix::Zero(part.vectors.rows(), part.vectors.cols()));
    for_each_member(group, [&](const auto& data, int first, std::size_t i) {
      for (std::size_t p = 0; p < columns_.size(); ++p) {
        const auto part = data.middleCols(columns_[p].first, columns_[p].count);
        const RowMatrix& vectors = group[i + p].vectors;
        auto weights = group[i + p].weights.middleRows(first, data.rows());
        product_transposed(part, vectors, weights);
        RowMatrix sum = RowMatrix::Zero(vectors.rows(), vectors.cols());
        add_transposed_product(weights, part, sum);
        parallel_for(sum.rows(), 1, [&](std::int64_t begin, std::int64_t end) {
          mixed[i + p].middleRows(begin, end - begin) +=
              sum.middleRows(begin, end - begin).cast<double>();
        });
      }
    });
    return mixed;
  }

  // Weights of the own rows, and their Gram matrices.
  std::vector<DoubleRowMatrix> project(std::vector<Refinement>& group) {
    for_each_member(group, [&](const auto& data, int first, std::size_t i) {
      for (std::size_t p = 0; p < columns_.size(); ++p) {
        const auto part = data.middleCols(columns_[p].first, columns_[p].count);
        auto weights = group[i + p].weights.middleRows(first, data.rows());
        product_transposed(part, group[i + p].vectors, weights);
        energy_ += part.rowwise().squaredNorm().template cast<double>().sum();
      }
    });
    std::vector<DoubleRowMatrix> grams;
    for (const Refinement& part : group) {
      const Eigen::MatrixXd weights = part.weights.cast<double>();
      grams.emplace_back(weights.transpose() * weights);
    }
    return grams;
  }

  // Within what is carried, the best directions are the eigenvectors of the weights' Gram matrix.
  void finish(const Refinement& part, const DoubleRowMatrix& gram) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(gram);
    const std::vector<int>& members = members_[static_cast<std::size_t>(part.cluster)];
    const Eigen::Index carried = gram.rows();
    const double largest = solver.eigenvalues()[carried - 1];
    const auto [first, count] = components_[part.part];
    for (int j = 0; j < std::min<Eigen::Index>(count, carried); ++j) {
      const double value = solver.eigenvalues()[carried - 1 - j];
      if (!(value > kRankTolerance * largest)) break;
      explained_ += value;
      const Eigen::VectorXd mix = solver.eigenvectors().col(carried - 1 - j);
      pca_.eigenvectors[part.part].row(part.cluster * count + j) =
          mix.cast<float>().transpose() * part.vectors;
      const Eigen::VectorXd rotated = part.weights.cast<double>() * mix;
      for (std::size_t i = 0; i < members.size(); ++i)
        pca_.weights(members[i], first + j) =
            static_cast<float>(rotated[static_cast<Eigen::Index>(i)]);
    }
  }

  const RowSource& source_;
  const Projection& projection_;
  const RowClusters& clusters_;
  Communicator& ranks_;
  Progress& progress_;
  LocalPca& pca_;
  std::vector<ColumnRange> columns_;
  std::vector<ColumnRange> components_;
  RowMatrix block_;
  std::vector<std::vector<int>> members_;  // [cluster]: this rank's rows, numbered as in the source
  double energy_ = 0.0;                    // of the own rows
  double explained_ = 0.0;                 // of all ranks' rows
};

}  // namespace

void refine_eigenvectors(const RowSource& source,
                         std::span<const int> rows,
                         const Projection& projection,
                         const RowClusters& clusters,
                         const LocalPcaOptions& options,
                         Communicator& ranks,
                         Progress& progress,
                         LocalPca& pca) {
  EigenvectorFit(source, rows, projection, clusters, options, ranks, progress, pca).run();
}

}  // namespace veneer::btf
