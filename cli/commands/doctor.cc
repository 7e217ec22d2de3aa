// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "base/parallel.h"
#include "btf/models/matrix_product.h"
#include "cli/commands/commands.h"
#include "cli/ranks/ranks.h"
#include "render/egl_context.h"
#include "tracking/usb_access.h"

namespace veneer::cli {
namespace {

struct Trackers {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  std::string text;
  bool all_usable = true;
};

/// Those that are plugged in, and what keeps them from being used.
Trackers look_at_trackers() {
  Trackers result;
  for (const tracking::UsbDevice& device : tracking::usb_devices()) {
    const Status access = tracking::check_access(device);
    const std::string problem = access ? "" : access.error().what;
    result.json.push_back({{"driver", device.driver},
                           {"model", device.model},
                           {"serial", device.serial},
                           {"port", device.port},
                           {"usable", access.has_value()},
                           {"problem", problem}});
    result.text += access ? fmt::format("\ntracker  {} on usb port {}", device.model, device.port)
                          : fmt::format("\ntracker  not usable: {}", problem);
    result.all_usable = result.all_usable && access.has_value();
  }
  if (result.text.empty()) result.text = "\ntracker  none on USB";
  return result;
}

}  // namespace

Result<int> run_doctor(CommandLine& line) {
  line.parse();
  const Result<render::EglContext> egl = render::EglContext::create();
  const std::string gl = egl ? egl->description() : egl.error().what;
  const std::string blas = btf::blas_description();
  const Trackers trackers = look_at_trackers();
  line.print({{"gl", gl},
              {"gl_usable", egl.has_value()},
              {"blas", blas},
              {"mpi", mpi_description()},
              {"threads", thread_count()},
              {"trackers", trackers.json}},
             fmt::format("OpenGL   {}{}\nBLAS     {}\nMPI      {}\nthreads  {}{}",
                         egl ? "" : "not usable: ",
                         gl,
                         blas,
                         mpi_description(),
                         thread_count(),
                         trackers.text));
  return egl && trackers.all_usable ? kExitDone : kExitFailed;
}

}  // namespace veneer::cli
