// SPDX-License-Identifier: Apache-2.0
#include "btf/models/weighted_pca.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/result.h"
#include "btf/models/local_pca_rows.h"

namespace veneer::btf {
namespace {

// The columns of a part, by whether they count.
struct Columns {
  std::vector<Eigen::Index> weighted;
  std::vector<float> roots;  // of the weights of these
  std::vector<Eigen::Index> others;
};

Columns columns_of(std::span<const float> weights) {
  Columns columns;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] > 0.0F) {
      columns.weighted.push_back(static_cast<Eigen::Index>(i));
      columns.roots.push_back(std::sqrt(weights[i]));
    } else {
      columns.others.push_back(static_cast<Eigen::Index>(i));
    }
  }
  return columns;
}

// Chosen columns of each part, scaled by `scale` or, where that is empty, as they are.
RowSource chosen(const RowSource& source,
                 const std::vector<Eigen::Index>& columns,
                 std::vector<float> scale) {
  const int whole = source.part_columns.front();
  const std::size_t parts = source.part_columns.size();
  RowSource some;
  some.rows = source.rows;
  some.part_columns.assign(parts, static_cast<int>(columns.size()));
  some.read = [&source, &columns, scale = std::move(scale), whole, parts](int row,
                                                                          std::span<float> values) {
    std::vector<float> all(parts * static_cast<std::size_t>(whole));
    source.read(row, all);
    auto out = values.begin();
    for (std::size_t p = 0; p < parts; ++p)
      for (std::size_t i = 0; i < columns.size(); ++i)
        *out++ = all[p * static_cast<std::size_t>(whole) + static_cast<std::size_t>(columns[i])] *
                 (scale.empty() ? 1.0F : scale[i]);
  };
  return some;
}

// Of each part, [cluster * component][column]: sum(weight * value) over a cluster's rows.
std::vector<DoubleRowMatrix> sums_of(const RowSource& source,
                                     const LocalPca& pca,
                                     const std::vector<ColumnRange>& components,
                                     Communicator& ranks) {
  const int columns = source.part_columns.front();
  std::vector<DoubleRowMatrix> sums;
  for (const ColumnRange& part : components)
    sums.emplace_back(DoubleRowMatrix::Zero(pca.clusters * part.count, columns));
  const RowRange own = rows_of_rank(source.rows, ranks);
  std::vector<std::vector<int>> members(static_cast<std::size_t>(pca.clusters));
  for (int row = own.first; row < own.first + own.count; ++row)
    members[pca.cluster[static_cast<std::size_t>(row)]].push_back(row);
  RowMatrix block(std::min(kBlockRows, source.rows), source.columns());
  for (int k = 0; k < pca.clusters; ++k) {
    const std::vector<int>& rows = members[static_cast<std::size_t>(k)];
    for_each_block(source, rows, block, [&](const auto& data, int first) {
      for (std::size_t p = 0; p < components.size(); ++p) {
        const auto [from, count] = components[p];
        RowMatrix weights(data.rows(), count);
        for (Eigen::Index i = 0; i < data.rows(); ++i)
          weights.row(i) =
              pca.weights.row(rows[static_cast<std::size_t>(first + i)]).segment(from, count);
        RowMatrix sum = RowMatrix::Zero(count, columns);
        add_transposed_product(
            weights, data.middleCols(static_cast<Eigen::Index>(p) * columns, columns), sum);
        sums[p].middleRows(k * count, count) += sum.cast<double>();
      }
    });
  }
  sum_over_ranks(sums, ranks);
  return sums;
}

// sum(weight^2) over each cluster's rows, [cluster][component].
Eigen::MatrixXd squares_of(const LocalPca& pca) {
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(pca.clusters, pca.weights.cols());
  for (Eigen::Index row = 0; row < pca.weights.rows(); ++row)
    squares.row(pca.cluster[static_cast<std::size_t>(row)]) +=
        pca.weights.row(row).cast<double>().cwiseAbs2();
  return squares;
}

}  // namespace

LocalPca fit_weighted_pca(const RowSource& source,
                          std::span<const float> weights,
                          const LocalPcaOptions& options,
                          Progress& progress,
                          Communicator& ranks) {
  if (weights.empty()) return fit_local_pca(source, options, progress, ranks);
  VENEER_CHECK(std::ranges::all_of(source.part_columns, [&](int count) {
    return static_cast<std::size_t>(count) == weights.size();
  }));
  const Columns columns = columns_of(weights);
  VENEER_CHECK(!columns.weighted.empty());
  LocalPca pca =
      fit_local_pca(chosen(source, columns.weighted, columns.roots), options, progress, ranks);

  const std::vector<ColumnRange> components = ranges_of(options.components);
  const std::vector<DoubleRowMatrix> sums =
      columns.others.empty() ? std::vector<DoubleRowMatrix>()
                             : sums_of(chosen(source, columns.others, {}), pca, components, ranks);
  const Eigen::MatrixXd squares = squares_of(pca);
  for (std::size_t p = 0; p < components.size(); ++p) {
    const RowMatrix& scaled = pca.eigenvectors[p];
    RowMatrix all(scaled.rows(), static_cast<Eigen::Index>(weights.size()));
    for (Eigen::Index row = 0; row < all.rows(); ++row) {
      float largest = 0.0F;
      for (std::size_t i = 0; i < columns.weighted.size(); ++i) {
        const float value = scaled(row, static_cast<Eigen::Index>(i)) / columns.roots[i];
        all(row, columns.weighted[i]) = value;
        largest = std::max(largest, std::abs(value));
      }
      const auto [first, count] = components[p];
      const double square = squares(row / count, first + row % count);
      for (std::size_t i = 0; i < columns.others.size(); ++i) {
        const double value = square > 0.0 ? sums[p](row, static_cast<Eigen::Index>(i)) / square : 0;
        all(row, columns.others[i]) = std::clamp(static_cast<float>(value), -largest, largest);
      }
    }
    pca.eigenvectors[p] = std::move(all);
  }
  return pca;
}

}  // namespace veneer::btf
