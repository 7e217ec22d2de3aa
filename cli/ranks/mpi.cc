// SPDX-License-Identifier: Apache-2.0
#include <mpi.h>

#include <algorithm>
#include <exception>
#include <limits>
#include <string>

#include "base/exit_code.h"
#include "cli/ranks/launcher.h"
#include "cli/ranks/ranks.h"

namespace veneer::cli {
namespace {

// MPI counts in int; larger sums also travel better in pieces.
constexpr std::size_t kMostSummed = std::size_t{1} << 22U;

// An error of MPI itself ends all ranks with a message of its own, which is its default.
class MpiRanks final : public btf::Communicator {
 public:
  MpiRanks() {
    MPI_Init(nullptr, nullptr);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
  }
  MpiRanks(const MpiRanks&) = delete;
  MpiRanks& operator=(const MpiRanks&) = delete;
  ~MpiRanks() override {
    if (std::uncaught_exceptions() == 0) {
      MPI_Finalize();
      return;
    }
    fmt::print(stderr,
               "veneer: rank {} of {} could not go on, which ends all; nothing was written. Fewer "
               "ranks on a machine leave more memory for each\n",
               rank_,
               size_);
    MPI_Abort(MPI_COMM_WORLD, kExitFailed);
  }

  int rank() const override { return rank_; }
  int size() const override { return size_; }

  // To one rank and from there to all, since MPI does not promise that MPI_Allreduce gives all
  // ranks the same bits.
  void sum(std::span<double> values) override {
    for (std::size_t first = 0; first < values.size(); first += kMostSummed) {
      const std::span<double> piece =
          values.subspan(first, std::min(kMostSummed, values.size() - first));
      const int count = static_cast<int>(piece.size());
      MPI_Reduce(rank_ == 0 ? MPI_IN_PLACE : piece.data(),
                 rank_ == 0 ? piece.data() : nullptr,
                 count,
                 MPI_DOUBLE,
                 MPI_SUM,
                 0,
                 MPI_COMM_WORLD);
      MPI_Bcast(piece.data(), count, MPI_DOUBLE, 0, MPI_COMM_WORLD);
    }
  }

  std::vector<std::byte> gather(std::span<const std::byte> own) override {
    VENEER_CHECK(own.size() <= static_cast<std::size_t>(std::numeric_limits<int>::max()));
    const int length = static_cast<int>(own.size());
    std::vector<int> lengths(static_cast<std::size_t>(size_));
    MPI_Allgather(&length, 1, MPI_INT, lengths.data(), 1, MPI_INT, MPI_COMM_WORLD);
    std::vector<int> places;
    std::int64_t total = 0;
    for (const int each : lengths) {
      places.push_back(static_cast<int>(total));
      total += each;
      VENEER_CHECK(total <= std::numeric_limits<int>::max());
    }
    std::vector<std::byte> all(static_cast<std::size_t>(total));
    MPI_Allgatherv(own.data(),
                   length,
                   MPI_BYTE,
                   all.data(),
                   lengths.data(),
                   places.data(),
                   MPI_BYTE,
                   MPI_COMM_WORLD);
    return all;
  }

 private:
  int rank_ = 0;
  int size_ = 1;
};

}  // namespace

Result<std::unique_ptr<btf::Communicator>> connect_ranks() {
  if (launched_processes() == 1) return std::make_unique<btf::Alone>();
  return std::make_unique<MpiRanks>();
}

std::string mpi_description() {
  std::string text(MPI_MAX_LIBRARY_VERSION_STRING, '\0');
  int length = 0;
  MPI_Get_library_version(text.data(), &length);
  text.resize(static_cast<std::size_t>(std::max(length, 0)));
  return text.substr(0, text.find(','));
}

}  // namespace veneer::cli
