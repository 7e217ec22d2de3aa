// SPDX-License-Identifier: Apache-2.0
#include "btf/models/local_pca.h"

#include <Eigen/SVD>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <iostream>
#include <string>

#include "base/random.h"
#include "btf/internal_test_sets.h"
#include "btf/internal_thread_ranks.h"

namespace veneer::btf {
namespace {

// Float products of a few hundred terms, relative to the data's norm.
constexpr double kFloatTolerance = 1e-5;

RowMatrix random_matrix(int rows, int columns, std::uint64_t seed) {
  Pcg32 random(seed);
  RowMatrix matrix(rows, columns);
  for (float& value : matrix.reshaped()) value = static_cast<float>(random.normal());
  return matrix;
}

RowSource source_of(const RowMatrix& data, std::vector<int> part_columns) {
  return {static_cast<int>(data.rows()),
          std::move(part_columns),
          [&data](int row, std::span<float> values) {
            Eigen::Map<Eigen::RowVectorXf>(values.data(), data.cols()) = data.row(row);
          }};
}

LocalPca fit(const RowMatrix& data, const LocalPcaOptions& options) {
  SilentProgress progress;
  return fit_local_pca(source_of(data, {static_cast<int>(data.cols())}), options, progress);
}

// What the factors of one part give back.
RowMatrix reconstruct(const LocalPca& pca, std::size_t part, int first, int count) {
  const RowMatrix& vectors = pca.eigenvectors[part];
  RowMatrix result(pca.weights.rows(), vectors.cols());
  for (Eigen::Index row = 0; row < result.rows(); ++row)
    result.row(row) = pca.weights.row(row).segment(first, count) *
                      vectors.middleRows(pca.cluster[static_cast<std::size_t>(row)] * count, count);
  return result;
}

double relative_error(const RowMatrix& data, const LocalPca& pca) {
  const auto count = static_cast<int>(pca.weights.cols());
  return (data - reconstruct(pca, 0, 0, count)).norm() / data.norm();
}

TEST(LocalPca, IsExactWithAsManyComponentsAsRank) {
  const RowMatrix data = random_matrix(60, 3, 1) * random_matrix(3, 200, 2);
  for (const int basis : {0, 16, 160}) {
    const LocalPca pca = fit(data, {.clusters = 4, .components = {3}, .basis = basis});
    EXPECT_LT(relative_error(data, pca), kFloatTolerance) << "basis " << basis;
  }
}

TEST(LocalPca, ErrorFallsWithComponentsAndWithClusters) {
  const RowMatrix data = random_matrix(300, 40, 3) * random_matrix(40, 90, 4);
  double last = 1.0;
  for (const int components : {1, 2, 4, 8, 16}) {
    const double error =
        relative_error(data, fit(data, {.clusters = 4, .components = {components}}));
    EXPECT_LT(error, last) << components << " components";
    last = error;
  }
  last = 1.0;
  for (const int clusters : {1, 4, 16, 64}) {
    const double error = relative_error(data, fit(data, {.clusters = clusters, .components = {2}}));
    EXPECT_LT(error, last) << clusters << " clusters";
    last = error;
  }
}

TEST(LocalPca, OneClusterIsTheTruncatedSingularValueDecomposition) {
  // A spectrum that falls as slowly as that of real materials, in fewer basis columns than its
  // rank.
  RowMatrix left = random_matrix(200, 120, 5);
  for (Eigen::Index j = 0; j < left.cols(); ++j) left.col(j) *= 1.0F / static_cast<float>(1 + j);
  const RowMatrix data = left * random_matrix(120, 500, 6);
  const Eigen::VectorXd singular =
      Eigen::JacobiSVD<Eigen::MatrixXd>(data.cast<double>()).singularValues();
  const int components = 8;
  const double best = singular.tail(singular.size() - components).norm() / singular.norm();
  const double error =
      relative_error(data, fit(data, {.clusters = 1, .components = {components}, .basis = 40}));
  EXPECT_GE(error, best * (1.0 - kFloatTolerance));
  EXPECT_LT(error, best * 1.001);  // a basis and two power iterations lose less than a thousandth
}

TEST(LocalPca, FindsClustersThatAreThere) {
  // Three lines through the origin: no single component serves two of them.
  const RowMatrix lines = random_matrix(3, 50, 7);
  const RowMatrix lengths = random_matrix(90, 1, 8);
  RowMatrix data(90, 50);
  for (int row = 0; row < 90; ++row) data.row(row) = lengths(row, 0) * lines.row(row % 3);
  const LocalPca pca = fit(data, {.clusters = 3, .components = {1}});
  EXPECT_LT(relative_error(data, pca), kFloatTolerance);
  for (std::size_t row = 3; row < 90; ++row) EXPECT_EQ(pca.cluster[row], pca.cluster[row % 3]);
}

TEST(LocalPca, PartsShareClustersButNotEigenvectors) {
  const RowMatrix first = random_matrix(80, 2, 9) * random_matrix(2, 30, 10);
  const RowMatrix second = random_matrix(80, 1, 11) * random_matrix(1, 70, 12);
  RowMatrix data(80, 100);
  data << first, second;
  SilentProgress progress;
  const LocalPca pca =
      fit_local_pca(source_of(data, {30, 70}), {.clusters = 2, .components = {2, 1}}, progress);
  ASSERT_EQ(pca.weights.cols(), 3);
  EXPECT_LT((first - reconstruct(pca, 0, 0, 2)).norm(), kFloatTolerance * first.norm());
  EXPECT_LT((second - reconstruct(pca, 1, 2, 1)).norm(), kFloatTolerance * second.norm());
}

TEST(LocalPca, EigenvectorsAreOrthonormalInEveryCluster) {
  const RowMatrix data = random_matrix(200, 64, 13);
  const int components = 4;
  const LocalPca pca = fit(data, {.clusters = 5, .components = {components}});
  for (int k = 0; k < pca.clusters; ++k) {
    const auto vectors = pca.eigenvectors[0].middleRows(k * components, components);
    EXPECT_LT((vectors * vectors.transpose() - RowMatrix::Identity(components, components)).norm(),
              kFloatTolerance * 10)
        << "cluster " << k;
  }
}

TEST(LocalPca, UnexplainedIsTheSquaredErrorOfTheFactors) {
  const RowMatrix data = random_matrix(150, 30, 14);
  const LocalPca pca = fit(data, {.clusters = 3, .components = {2}});
  EXPECT_NEAR(pca.unexplained, std::pow(relative_error(data, pca), 2), 1e-5);
}

TEST(LocalPca, IsTheSameForTheSameSeed) {
  const RowMatrix data = random_matrix(120, 40, 15);
  const LocalPcaOptions options{.clusters = 6, .components = {2}, .seed = 9};
  const LocalPca a = fit(data, options);
  const LocalPca b = fit(data, options);
  EXPECT_EQ(a.cluster, b.cluster);
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_EQ(a.eigenvectors[0], b.eigenvectors[0]);
}

// For the test below, which runs this one in processes of its own: the number of threads is settled
// when it is first asked for. Large enough for several blocks of every product.
TEST(LocalPca, DISABLED_PrintsItsResult) {
  const RowMatrix data = random_matrix(700, 300, 21) * random_matrix(300, 2500, 22);
  const LocalPca pca = fit(data, {.clusters = 5, .components = {3}, .iterations = 5});
  std::uint64_t hash = 0;
  for (const float value : pca.weights.reshaped())
    hash = hash * 1099511628211U + std::bit_cast<std::uint32_t>(value);
  std::cout << "result " << hash << std::endl;
}

TEST(LocalPca, IsTheSameForAnyNumberOfThreads) {
  EXPECT_EQ(testing::results_on_threads("LocalPca.DISABLED_PrintsItsResult", {1, 2, 3}).size(), 1U);
}

// The same rows, sums made in another order. Of each rank, so that all are seen to have everything.
TEST(LocalPca, IsTheSameOnAnyNumberOfRanks) {
  struct Case {
    int rows;
    int columns;
    LocalPcaOptions options;
  };
  for (const Case& c : {Case{700, 300, {.clusters = 5, .components = {3}, .basis = 40}},
                        Case{701, 90, {.clusters = 9, .components = {2}, .basis = 0}},
                        Case{5000, 40, {.clusters = 6, .components = {2}, .basis = 20}},
                        Case{2, 40, {.clusters = 4, .components = {2}}}}) {
    const RowMatrix data = random_matrix(c.rows, 30, 23) * random_matrix(30, c.columns, 24) +
                           0.1F * random_matrix(c.rows, c.columns, 25);
    const LocalPca single = fit(data, c.options);
    const RowMatrix expected = reconstruct(single, 0, 0, c.options.components.front());
    for (const int size : {2, 3}) {
      run_on_ranks(size, [&](Communicator& ranks) {
        SilentProgress progress;
        const LocalPca pca =
            fit_local_pca(source_of(data, {c.columns}), c.options, progress, ranks);
        const std::string where =
            fmt::format("{} x {}, rank {} of {}", c.rows, c.columns, ranks.rank(), ranks.size());
        EXPECT_EQ(pca.cluster, single.cluster) << where;
        EXPECT_LT((reconstruct(pca, 0, 0, c.options.components.front()) - expected).norm(),
                  kFloatTolerance * expected.norm())
            << where;
        EXPECT_NEAR(pca.unexplained, single.unexplained, kFloatTolerance) << where;
      });
    }
  }
}

TEST(LocalPca, ReadsOnlyItsOwnRows) {
  const RowMatrix data = random_matrix(100, 20, 26);
  run_on_ranks(3, [&](Communicator& ranks) {
    RowSource source = source_of(data, {20});
    const RowRange own = rows_of_rank(100, ranks);
    source.read = [read = source.read, own](int row, std::span<float> values) {
      EXPECT_TRUE(row >= own.first && row < own.first + own.count);
      read(row, values);
    };
    SilentProgress progress;
    EXPECT_EQ(fit_local_pca(source, {.clusters = 3, .components = {2}}, progress, ranks).clusters,
              3);
  });
}

TEST(LocalPca, IsDefinedAtTheEdges) {
  const RowMatrix zero = RowMatrix::Zero(20, 30);
  const RowMatrix same = RowMatrix::Ones(20, 30);
  RowMatrix mixed = zero;
  mixed.row(7).setOnes();
  const RowMatrix one = random_matrix(1, 30, 16);
  const RowMatrix narrow = random_matrix(40, 1, 17);
  const RowMatrix two = random_matrix(2, 5, 18);
  for (const RowMatrix* data :
       std::initializer_list<const RowMatrix*>{&zero, &same, &mixed, &one, &narrow, &two}) {
    for (const int clusters : {1, 3, 50}) {
      for (const int components : {1, 4}) {
        for (const int basis : {0, 160}) {
          const LocalPca pca =
              fit(*data, {.clusters = clusters, .components = {components}, .basis = basis});
          const std::string where = fmt::format("{} x {}, {} clusters, {} components, basis {}",
                                                data->rows(),
                                                data->cols(),
                                                clusters,
                                                components,
                                                basis);
          EXPECT_LE(pca.clusters, std::min<Eigen::Index>(clusters, data->rows())) << where;
          EXPECT_TRUE(pca.weights.allFinite()) << where;
          EXPECT_TRUE(pca.eigenvectors[0].allFinite()) << where;
          for (const int k : pca.cluster) EXPECT_LT(k, pca.clusters) << where;
          // Each of these has rank 1 at most in any cluster of one row; rank 2 with four
          // components.
          if (clusters == 50 || components == 4 || data != &two) {
            EXPECT_LE((*data - reconstruct(pca, 0, 0, components)).norm(),
                      kFloatTolerance * std::max(1.0F, data->norm()))
                << where;
          }
        }
      }
    }
  }
}

TEST(LocalPca, RefillsClustersWhileRowsDiffer) {
  // As many clusters as different rows: each row must be exact although k-means may start badly.
  const RowMatrix data = random_matrix(24, 10, 19);
  const LocalPca pca = fit(data, {.clusters = 24, .components = {1}});
  EXPECT_LT(relative_error(data, pca), kFloatTolerance);
}

}  // namespace
}  // namespace veneer::btf
