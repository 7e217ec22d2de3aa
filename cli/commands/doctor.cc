// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "base/parallel.h"
#include "btf/models/matrix_product.h"
#include "cli/commands/commands.h"
#include "cli/ranks/ranks.h"
#include "render/egl_context.h"

namespace veneer::cli {

Result<int> run_doctor(CommandLine& line) {
  line.parse();
  const Result<render::EglContext> egl = render::EglContext::create();
  const std::string gl = egl ? egl->description() : egl.error().what;
  const std::string blas = btf::blas_description();
  line.print({{"gl", gl},
              {"gl_usable", egl.has_value()},
              {"blas", blas},
              {"mpi", mpi_description()},
              {"threads", thread_count()}},
             fmt::format("OpenGL   {}{}\nBLAS     {}\nMPI      {}\nthreads  {}",
                         egl ? "" : "not usable: ",
                         gl,
                         blas,
                         mpi_description(),
                         thread_count()));
  return egl ? kExitDone : kExitFailed;
}

}  // namespace veneer::cli
