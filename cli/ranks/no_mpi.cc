// SPDX-License-Identifier: Apache-2.0
#include "cli/ranks/launcher.h"
#include "cli/ranks/ranks.h"

namespace veneer::cli {

Result<std::unique_ptr<btf::Communicator>> connect_ranks() {
  if (launched_processes() > 1)
    return fail(
        Errc::kInvalidOption,
        "joining {} processes: this veneer was built without MPI; install libopenmpi-dev and "
        "build again, or run it without mpirun",
        launched_processes());
  return std::make_unique<btf::Alone>();
}

std::string mpi_description() { return "none"; }

}  // namespace veneer::cli
