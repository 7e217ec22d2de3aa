// SPDX-License-Identifier: Apache-2.0
#include "btf/models/local_pca_rows.h"

#include <Eigen/QR>

#include "base/parallel.h"

namespace veneer::btf {

std::vector<ColumnRange> ranges_of(const std::vector<int>& counts) {
  std::vector<ColumnRange> ranges;
  int first = 0;
  for (const int count : counts) {
    ranges.push_back({first, count});
    first += count;
  }
  return ranges;
}

void orthonormalise_rows(RowMatrix& rows) {
  const Eigen::Map<Eigen::MatrixXf> columns(rows.data(), rows.cols(), rows.rows());
  const Eigen::HouseholderQR<Eigen::MatrixXf> qr(columns);
  const Eigen::MatrixXf q = qr.householderQ() * Eigen::MatrixXf::Identity(rows.cols(), rows.rows());
  rows = q.transpose();
}

void read_rows(const RowSource& source, std::span<const int> rows, RowMatrix& block) {
  const auto columns = static_cast<std::size_t>(block.cols());
  parallel_for(
      static_cast<std::int64_t>(rows.size()), 8, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i)
          source.read(rows[static_cast<std::size_t>(i)], {block.row(i).data(), columns});
      });
}

std::size_t block_length(std::span<const int> rows, std::size_t first) {
  const std::size_t most = std::min<std::size_t>(rows.size() - first, kBlockRows);
  const int chunk = rows[first] / kChunkRows;
  std::size_t length = 1;
  while (length < most && rows[first + length] / kChunkRows == chunk) ++length;
  return length;
}

void sum_over_ranks(std::span<DoubleRowMatrix> matrices, Communicator& ranks) {
  if (ranks.size() == 1) return;
  std::vector<double> all;
  for (const DoubleRowMatrix& matrix : matrices)
    all.insert(all.end(), matrix.data(), matrix.data() + matrix.size());
  ranks.sum(all);
  auto from = all.begin();
  for (DoubleRowMatrix& matrix : matrices) {
    std::copy_n(from, matrix.size(), matrix.data());
    from += matrix.size();
  }
}

void ChunkedSum::end_chunk(Threads threads) {
  const auto add = [this](std::int64_t begin, std::int64_t end) {
    const auto count = static_cast<Eigen::Index>(end - begin);
    const auto first = static_cast<Eigen::Index>(begin);
    total_.middleRows(first, count) += chunk_.middleRows(first, count).cast<double>();
    chunk_.middleRows(first, count).setZero();
  };
  if (threads == Threads::kAll)
    parallel_for(total_.rows(), 4, add);
  else
    add(0, total_.rows());
}

}  // namespace veneer::btf
