// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "btf/communicator.h"
#include "btf/models/local_pca.h"

// What the steps of local PCA share: how rows are read, in which order they are summed.
namespace veneer::btf {

/// Sums over rows are in float within a chunk, rows [n * kChunkRows, (n + 1) * kChunkRows), and in
/// double from chunk to chunk. Ranks own whole chunks where there are enough, so that the number of
/// ranks changes results by the rounding of doubles only.
constexpr int kChunkRows = 2048;
/// Rows that are in memory at a time, as float: 40 MB of a Bonn set.
constexpr int kBlockRows = 512;
static_assert(kChunkRows % kBlockRows == 0);

using DoubleRowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The columns [first, first + count) of each part in some matrix.
struct ColumnRange {
  int first;
  int count;
};
[[nodiscard]] std::vector<ColumnRange> ranges_of(const std::vector<int>& counts);

/// Replaces the rows of `rows` by orthonormal ones that span them; where they are dependent, the
/// missing ones are arbitrary.
void orthonormalise_rows(RowMatrix& rows);

/// Reads the rows `rows`, on all threads, into the top of `block`.
void read_rows(const RowSource& source, std::span<const int> rows, RowMatrix& block);

/// How many of the rows at `first` and after, which ascend, make the next block: kBlockRows at most
/// and all of one chunk.
[[nodiscard]] std::size_t block_length(std::span<const int> rows, std::size_t first);

/// Calls body(block, first) for successive blocks of the listed rows: rows[first] and those after.
template <class Body>
void for_each_block(const RowSource& source,
                    std::span<const int> rows,
                    RowMatrix& block,
                    Body body) {
  for (std::size_t first = 0; first < rows.size();) {
    const std::size_t length = block_length(rows, first);
    read_rows(source, rows.subspan(first, length), block);
    body(block.topRows(static_cast<Eigen::Index>(length)), static_cast<int>(first));
    first += length;
  }
}

/// Sums matrices over the ranks, all at once.
void sum_over_ranks(std::span<DoubleRowMatrix> matrices, Communicator& ranks);

/// A sum of float matrices, in float within a chunk and in double beyond it.
class ChunkedSum {
 public:
  ChunkedSum(Eigen::Index rows, Eigen::Index columns)
      : chunk_(RowMatrix::Zero(rows, columns)), total_(DoubleRowMatrix::Zero(rows, columns)) {}
  /// Where the sum of a chunk is made.
  [[nodiscard]] RowMatrix& chunk() { return chunk_; }
  /// Takes the chunk's sum and begins another.
  void end_chunk(Threads threads);
  [[nodiscard]] DoubleRowMatrix& total() { return total_; }

 private:
  RowMatrix chunk_;
  DoubleRowMatrix total_;
};

}  // namespace veneer::btf
