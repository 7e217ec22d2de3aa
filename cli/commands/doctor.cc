// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "base/parallel.h"
#include "btf/models/matrix_product.h"
#include "calibration/instruments/instruments.h"
#include "capture/cameras/cameras.h"
#include "cli/commands/commands.h"
#include "cli/doctor/connector_text.h"
#include "cli/ranks/ranks.h"
#include "cli/service/status_text.h"
#include "projector/control/dlpc350/dlpc350.h"
#include "projector/outputs/kms/displays.h"
#include "projector/outputs/window/displays.h"
#include "render/egl_context.h"
#include "service/bus/bus_client.h"
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

struct Instruments {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  std::string text;
};

/// The colorimeters that are plugged in, and what keeps them from being used.
Instruments look_at_instruments() {
  Instruments result;
  const auto connected = calibration::connected_instruments();
  if (!connected) {
    result.text = "\ncolorimeter  " + connected.error().what;
    return result;
  }
  for (const calibration::ConnectedInstrument& each : *connected) {
    result.json.push_back({{"model", each.model},
                           {"usb_id", each.usb_id},
                           {"port", each.usb_port},
                           {"driver", each.driver},
                           {"remedy", each.remedy}});
    result.text += fmt::format("\ncolorimeter  {} on usb port {}{}{}",
                               each.model,
                               each.usb_port,
                               each.remedy.empty() ? "" : ": ",
                               each.remedy);
  }
  if (result.text.empty()) result.text = "\ncolorimeter  none on USB";
  return result;
}

struct Cameras {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  nlohmann::ordered_json failed = nlohmann::ordered_json::array();
  std::string text;
};

/// The cameras that answer, and what stands in the way of using or of finding them.
Cameras look_at_cameras() {
  Cameras result;
  const capture::CameraList list = capture::list_cameras();
  for (const capture::CameraInfo& each : list.found) {
    result.json.push_back({{"driver", each.driver},
                           {"model", each.model},
                           {"identity", each.identity},
                           {"state", each.state}});
    result.text += fmt::format("\ncamera   {} \"{}\" ({}){}{}",
                               each.driver,
                               each.identity,
                               each.model,
                               each.state.empty() ? "" : ": ",
                               each.state);
  }
  for (const capture::CameraListFailure& each : list.failed) {
    result.failed.push_back({{"driver", each.driver}, {"problem", each.error.what}});
    result.text += fmt::format("\ncamera   {}: {}", each.driver, each.error.what);
  }
  if (result.text.empty()) result.text = "\ncamera   none answers";
  return result;
}

/// The light engines on USB, and what keeps them from being controlled.
nlohmann::ordered_json look_at_light_engines(std::string& text) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const projector::ConnectedLightEngine& each : projector::connected_light_engines()) {
    json.push_back({{"model", each.model},
                    {"serial", each.serial},
                    {"node", each.node},
                    {"usable", each.may_open}});
    text += fmt::format("\nlight engine  {} at {}{}",
                        each.model,
                        each.node,
                        each.may_open ? ""
                                      : ": may not be opened; install "
                                        "etc/udev/60-veneer-projectors.rules");
  }
  if (text.empty()) text = "\nlight engine  none on USB";
  return json;
}

/// The displays of the desktop; none where there is no desktop, which a daemon does not need.
nlohmann::ordered_json look_at_displays(std::string& text) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  if (const auto displays = projector::list_displays()) {
    for (const projector::Display& d : *displays) {
      json.push_back({{"number", d.number},
                      {"name", d.name},
                      {"width", d.width},
                      {"height", d.height},
                      {"refresh_hz", d.refresh_hz}});
      text += fmt::format("\ndisplay  {}: {}, {} x {}", d.number, d.name, d.width, d.height);
    }
  }
  if (text.empty()) text = "\ndisplay  none: no desktop";
  return json;
}

struct Connectors {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  std::string problem;
  std::string text;
};

/// The sockets of the display cards, where veneerd shows without a desktop; or why none can be
/// told. A service that shows something there keeps its display.
Connectors look_at_connectors() {
  Connectors result;
  const auto displays = projector::kms_displays();
  if (!displays) {
    result.problem = displays.error().what;
    result.text = "\nconnector  " + result.problem;
    return result;
  }
  for (const projector::KmsDisplay& each : *displays) {
    result.json.push_back(json_of(each));
    result.text += "\nconnector  " + text_of(each);
  }
  return result;
}

/// How the service is, or why it cannot be asked. It need not run: the tools do without.
nlohmann::ordered_json look_at_service(const service::BusAddress& bus, std::string& text) {
  Result<service::BusClient> client = service::BusClient::connect(bus);
  const Result<service::ServiceStatus> status =
      client ? client->status() : tl::unexpected(client.error());
  if (!status) {
    text = "\nservice  " + status.error().what;
    return {{"running", false}, {"problem", status.error().what}};
  }
  text = fmt::format("\nservice  {}", line_of(*status, SteadyClock().now()));
  return {{"running", true}, {"state", name_of(status->state)}};
}

}  // namespace

Result<int> run_doctor(CommandLine& line) {
  std::string bus = "system";
  line.app()
      .add_option("--bus",
                  bus,
                  "Where the service is: system, session or an address such as unix:path=/run/bus")
      ->capture_default_str();
  line.parse();
  VENEER_ASSIGN(const service::BusAddress address, service::BusAddress::parse(bus));
  const Result<render::EglContext> egl = render::EglContext::create();
  const std::string gl = egl ? egl->description() : egl.error().what;
  const std::string blas = btf::blas_description();
  const Trackers trackers = look_at_trackers();
  const Instruments instruments = look_at_instruments();
  line.note("asking for cameras; those on Ethernet have a second to answer");
  const Cameras cameras = look_at_cameras();
  std::string light_engines_text;
  const nlohmann::ordered_json light_engines = look_at_light_engines(light_engines_text);
  std::string displays_text;
  const nlohmann::ordered_json displays = look_at_displays(displays_text);
  const Connectors connectors = look_at_connectors();
  std::string service_text;
  const nlohmann::ordered_json service = look_at_service(address, service_text);
  line.print({{"gl", gl},
              {"gl_usable", egl.has_value()},
              {"blas", blas},
              {"mpi", mpi_description()},
              {"threads", thread_count()},
              {"trackers", trackers.json},
              {"instruments", instruments.json},
              {"cameras", cameras.json},
              {"cameras_failed", cameras.failed},
              {"light_engines", light_engines},
              {"displays", displays},
              {"connectors", connectors.json},
              {"connectors_problem", connectors.problem},
              {"service", service}},
             fmt::format("OpenGL   {}{}\nBLAS     {}\nMPI      {}\nthreads  {}{}{}{}{}{}{}{}",
                         egl ? "" : "not usable: ",
                         gl,
                         blas,
                         mpi_description(),
                         thread_count(),
                         trackers.text,
                         instruments.text,
                         cameras.text,
                         light_engines_text,
                         displays_text,
                         connectors.text,
                         service_text));
  return egl && trackers.all_usable ? kExitDone : kExitFailed;
}

}  // namespace veneer::cli
