// SPDX-License-Identifier: Apache-2.0
#include "btf/models/local_pca_projection.h"

#include <numeric>

#include "base/parallel.h"
#include "base/random.h"

namespace veneer::btf {
namespace {

constexpr int kPowerIterations = 2;

// A generator for each row, so that a row has the same numbers on whichever rank it lies.
RowMatrix random_rows(std::span<const int> rows, int columns, std::uint64_t seed) {
  RowMatrix matrix(static_cast<Eigen::Index>(rows.size()), columns);
  parallel_for(matrix.rows(), 64, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) {
      // A large odd factor, so that neighbours have nothing in common.
      const auto row = static_cast<std::uint64_t>(rows[static_cast<std::size_t>(i)]);
      Pcg32 random(seed + (row + 1) * 0x9E3779B97F4A7C15ULL, 1);
      for (float& value : matrix.row(i)) value = static_cast<float>(random.normal());
    }
  });
  return matrix;
}

}  // namespace

Projection project(const RowSource& source,
                   std::span<const int> rows,
                   const LocalPcaOptions& options,
                   Communicator& ranks,
                   Progress& progress) {
  const auto own = static_cast<Eigen::Index>(rows.size());
  Projection projection;
  if (options.basis == 0) {
    projection.ranges = ranges_of(source.part_columns);
    projection.coordinates.resize(own, source.columns());
    read_rows(source, rows, projection.coordinates);
    return projection;
  }
  const std::vector<ColumnRange> columns = ranges_of(source.part_columns);
  std::vector<int> dimensions;
  for (const ColumnRange& part : columns)
    dimensions.push_back(std::min({options.basis, part.count, source.rows}));
  projection.ranges = ranges_of(dimensions);
  const int total = std::accumulate(dimensions.begin(), dimensions.end(), 0);
  RowMatrix block(std::min(kBlockRows, source.rows), source.columns());
  progress.start("basis", own * (kPowerIterations + 2));

  // A random mixture of the rows, then power iterations: rows <- rows * data^T * data.
  projection.coordinates = random_rows(rows, total, options.seed);
  for (int iteration = 0; iteration <= kPowerIterations; ++iteration) {
    std::vector<ChunkedSum> mixed;
    for (std::size_t p = 0; p < columns.size(); ++p)
      mixed.emplace_back(dimensions[p], columns[p].count);
    for_each_block(source, rows, block, [&](const auto& data, int first) {
      const auto next = rows[static_cast<std::size_t>(first)] + data.rows();
      const bool last_of_chunk = next % kChunkRows == 0 || next > rows.back();
      for (std::size_t p = 0; p < columns.size(); ++p) {
        const auto part = data.middleCols(columns[p].first, columns[p].count);
        const ColumnRange& range = projection.ranges[p];
        auto left = projection.coordinates.block(first, range.first, data.rows(), range.count);
        if (iteration > 0) product_transposed(part, projection.basis[p], left);
        add_transposed_product(left, part, mixed[p].chunk());
        if (last_of_chunk) mixed[p].end_chunk(Threads::kAll);
      }
      progress.advance(data.rows());
    });
    projection.basis.clear();
    for (ChunkedSum& sum : mixed) {
      ranks.sum({sum.total().data(), static_cast<std::size_t>(sum.total().size())});
      projection.basis.emplace_back(sum.total().cast<float>());
      orthonormalise_rows(projection.basis.back());
    }
  }

  for_each_block(source, rows, block, [&](const auto& data, int first) {
    for (std::size_t p = 0; p < columns.size(); ++p) {
      const ColumnRange& range = projection.ranges[p];
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

}  // namespace veneer::btf
