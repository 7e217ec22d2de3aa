// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdlib>

namespace veneer::cli {

/// How many processes an MPI launcher started, from what OpenMPI, and MPICH and its kin, tell them;
/// 1 where there is none. Known without MPI, whose start costs a tenth of a second.
[[nodiscard]] inline int launched_processes() {
  for (const char* name : std::array{"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"})
    if (const char* size = std::getenv(name)) return std::max(std::atoi(size), 1);
  return 1;
}

}  // namespace veneer::cli
