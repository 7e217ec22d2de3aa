// SPDX-License-Identifier: Apache-2.0
#include "btf/communicator.h"

#include <gtest/gtest.h>

#include <array>
#include <mutex>
#include <numeric>

#include "btf/internal_thread_ranks.h"

namespace veneer::btf {
namespace {

TEST(Communicator, RanksShareEveryRowOnceAndNearlyEvenly) {
  for (const int size : {1, 2, 3, 7, 64}) {
    for (const int rows : {0, 1, 2, 5, 63, 64, 1000, 4096, 65536, 160000}) {
      std::vector<RowRange> ranges(static_cast<std::size_t>(size));
      run_on_ranks(size, [&](Communicator& ranks) {
        ranges[static_cast<std::size_t>(ranks.rank())] = rows_of_rank(rows, ranks);
      });
      int next = 0;
      for (const RowRange& range : ranges) {
        EXPECT_EQ(range.first, next);
        EXPECT_GE(range.count, 0);
        EXPECT_LE(range.count, 1.25 * rows / size + 1.0) << rows << " rows, " << size << " ranks";
        next = range.first + range.count;
      }
      EXPECT_EQ(next, rows);
    }
  }
}

TEST(Communicator, RanksOfManyRowsBeginAtChunks) {
  run_on_ranks(2,
               [](Communicator& ranks) { EXPECT_EQ(rows_of_rank(65536, ranks).first % 4096, 0); });
}

TEST(Communicator, AloneKeepsWhatItHas) {
  std::array<double, 2> values{1.5, -2.0};
  alone().sum(values);
  EXPECT_EQ(values, (std::array<double, 2>{1.5, -2.0}));
  EXPECT_EQ(gather<double>(alone(), values), (std::vector<double>{1.5, -2.0}));
  EXPECT_TRUE(gather<double>(alone(), {}).empty());
  EXPECT_TRUE(agree(alone(), {}));
  EXPECT_EQ(agree(alone(), fail(Errc::kIo, "it broke")).error().what, "it broke");
}

TEST(Communicator, GatherKeepsTheOrderOfRanksOfAnyLength) {
  run_on_ranks(3, [](Communicator& ranks) {
    const std::vector<int> own(static_cast<std::size_t>(2 - ranks.rank()), ranks.rank());
    EXPECT_EQ(gather<int>(ranks, own), (std::vector<int>{0, 0, 1}));
  });
}

TEST(Communicator, OneRanksErrorIsEverybodys) {
  run_on_ranks(4, [](Communicator& ranks) {
    Status own;
    if (ranks.rank() == 2) own = fail(Errc::kBadFormat, "reading: too short");
    if (ranks.rank() == 3) own = fail(Errc::kIo, "something else");
    const Status all = agree(ranks, own);
    ASSERT_FALSE(all);
    EXPECT_EQ(all.error().code, Errc::kBadFormat);
    EXPECT_EQ(all.error().what, "rank 2: reading: too short");
    EXPECT_TRUE(agree(ranks, {}));
  });
}

}  // namespace
}  // namespace veneer::btf
