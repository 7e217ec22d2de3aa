// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "btf/communicator.h"

namespace veneer::cli {

/// The ranks that `mpirun` started this process among; one alone where nothing did. At most one
/// object at a time, once in the life of a process. Destroyed in the course of an exception it ends
/// all ranks, who would otherwise wait for this one; else it waits for the others.
///
/// Errors: kInvalidOption where mpirun started more than one process and this program was built
/// without MPI: each would do the whole work.
[[nodiscard]] Result<std::unique_ptr<btf::Communicator>> connect_ranks();

/// The MPI that this program was built with, for people, or "none".
[[nodiscard]] std::string mpi_description();

}  // namespace veneer::cli
