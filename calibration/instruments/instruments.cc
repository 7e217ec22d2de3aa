// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/instruments.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>

#include "calibration/exchange/cgats.h"
#include "calibration/instruments/camera/camera_colorimeter.h"
#include "calibration/instruments/colorhug/colorhug.h"
#include "calibration/instruments/file/file_colorimeter.h"
#include "calibration/instruments/spotread/spotread.h"
#include "tracking/transports/bus_device.h"

namespace veneer::calibration {
namespace {

using tracking::UsbId;

/// As the configuration writes it, relative to its own folder.
std::filesystem::path resolved(const TomlReader& config, const std::filesystem::path& path) {
  return path.empty() || path.is_absolute() ? path : config.folder() / path;
}

/// Options in seconds.
void read_seconds(TomlReader& config, std::string_view key, Duration& value) {
  constexpr double kLongest = 3600;
  double seconds = to_seconds(value);
  config.read(key, seconds);
  if (seconds > 0 && seconds <= kLongest) {
    value = from_seconds(seconds);
  } else {
    config.add_error(key, "set it above 0 and up to 3600 seconds");
  }
}

Result<std::unique_ptr<Colorimeter>> open_camera(TomlReader& config,
                                                 const InstrumentServices& services) {
  CameraColorimeterOptions options;
  Eigen::Vector2d spot = Eigen::Vector2d::Zero();
  config.require("xyz_from_rate", options.xyz_from_rate);
  config.require("spot", spot);
  config.read("spot_radius", options.spot_radius);
  config.read("black_level", options.black_level);
  config.read("frames", options.frames);
  VENEER_TRY(config.finish());
  VENEER_TRY(options.check());
  if (services.camera == nullptr)
    return fail(Errc::kUnavailable,
                "opening a camera as colorimeter: no camera is open; configure one");
  return std::make_unique<CameraColorimeter>(
      *services.camera, options, [spot](Target, const Eigen::Vector2d&) { return spot; });
}

Result<std::unique_ptr<Colorimeter>> open_colorhug(TomlReader& config,
                                                   const InstrumentServices& services) {
  ColorHugOptions options;
  options.identity = tracking::UsbIdentity::read(config);
  std::filesystem::path correction;
  config.read("calibration", options.calibration);
  config.read("correction", correction);
  read_seconds(config, "time_limit_s", options.time_limit);
  VENEER_TRY(config.finish());
  if (!correction.empty()) {
    VENEER_ASSIGN(const ColorimeterCorrection read, read_ccmx(resolved(config, correction)));
    options.corrected_from_read = read.corrected_from_read;
  }
  return ColorHug::open(options, services.clock);
}

Result<std::unique_ptr<Colorimeter>> open_file(TomlReader& config,
                                               const InstrumentServices& services) {
  std::filesystem::path white_reference;
  std::filesystem::path object;
  config.require("white_reference", white_reference);
  config.read("object", object);
  VENEER_TRY(config.finish());
  if (services.display == nullptr)
    return fail(Errc::kUnavailable,
                "opening a file of readings: no display tells what it shows; configure one");
  VENEER_ASSIGN(MeasuredPatches white, read_ti3(resolved(config, white_reference)));
  std::optional<MeasuredPatches> of_object;
  if (!object.empty()) {
    VENEER_ASSIGN(of_object, read_ti3(resolved(config, object)));
  }
  return std::make_unique<FileColorimeter>(
      std::move(white), std::move(of_object), *services.display);
}

Result<std::unique_ptr<Colorimeter>> open_spotread(TomlReader& config,
                                                   const InstrumentServices& services) {
  SpotreadOptions options;
  config.read("program", options.program);
  config.read("port", options.port);
  config.read("display_type", options.display_type);
  config.read("correction", options.correction);
  config.read("retries", options.retries);
  read_seconds(config, "start_limit_s", options.start_limit);
  read_seconds(config, "reading_limit_s", options.reading_limit);
  VENEER_TRY(config.finish());
  options.correction = resolved(config, options.correction);
  // A bare name is looked for in PATH.
  if (options.program.has_parent_path()) options.program = resolved(config, options.program);
  return Spotread::open(options, services.ask, services.clock);
}

constexpr std::array kInstruments{
    InstrumentDriver{"camera", "a camera, by a matrix fitted on known patches", &open_camera},
    InstrumentDriver{"colorhug", "a ColorHug2, over HID", &open_colorhug},
    InstrumentDriver{"file", "readings of earlier, from a .ti3", &open_file},
    InstrumentDriver{"spotread", "all that ArgyllCMS reads, by its program", &open_spotread},
};
static_assert(std::ranges::is_sorted(kInstruments, {}, &InstrumentDriver::name));

/// How a colorimeter shows on USB.
struct Appearance {
  UsbId id;
  std::string_view model;
  std::string_view driver;
  std::string_view remedy;
};

constexpr std::string_view kBootLoader =
    "it is in its boot loader: plug it out and in again, or load its firmware anew "
    "(colorhug-flash)";

/// Those that measure light. Ids as ArgyllCMS's own udev rules have them.
constexpr std::array kAppearances{
    Appearance{{0x04d8, 0xf8da}, "ColorHug, early", "spotread", ""},
    Appearance{{0x04db, 0x005b}, "Colorimetre HCFR", "spotread", ""},
    Appearance{{0x0765, 0x5001}, "huey", "spotread", ""},
    Appearance{{0x0765, 0x5010}, "huey", "spotread", ""},
    Appearance{{0x0765, 0x5020}, "i1Display Pro, ColorMunki Display", "spotread", ""},
    Appearance{{0x0765, 0x6003}, "ColorMunki Smile", "spotread", ""},
    Appearance{{0x0765, 0x6008}, "ColorMunki, i1Studio", "spotread", ""},
    Appearance{{0x0765, 0x6009}, "i1Pro 3", "spotread", ""},
    Appearance{{0x0765, 0xd094}, "DTP94", "spotread", ""},
    Appearance{{0x085c, 0x0200}, "Spyder2", "spotread", ""},
    Appearance{{0x085c, 0x0300}, "Spyder3", "spotread", ""},
    Appearance{{0x085c, 0x0400}, "Spyder4", "spotread", ""},
    Appearance{{0x085c, 0x0500}, "Spyder5", "spotread", ""},
    Appearance{{0x085c, 0x0a00}, "SpyderX", "spotread", ""},
    Appearance{{0x0971, 0x2000}, "i1Pro", "spotread", ""},
    Appearance{{0x0971, 0x2003}, "i1Display", "spotread", ""},
    Appearance{{0x0971, 0x2005}, "huey", "spotread", ""},
    Appearance{{0x0971, 0x2007}, "ColorMunki", "spotread", ""},
    Appearance{{0x273f, 0x1000}, "ColorHug", "", kBootLoader},
    Appearance{{0x273f, 0x1001}, "ColorHug", "spotread", ""},
    Appearance{{0x273f, 0x1004}, "ColorHug2", "colorhug", ""},
    Appearance{{0x273f, 0x1005}, "ColorHug2", "", kBootLoader},
};

}  // namespace

std::span<const InstrumentDriver> instrument_drivers() { return kInstruments; }

Result<std::unique_ptr<Colorimeter>> open_instrument(TomlReader& config,
                                                     const InstrumentServices& services) {
  std::string name;
  config.read("driver", name);
  const auto driver = std::ranges::find(kInstruments, name, &InstrumentDriver::name);
  if (driver != kInstruments.end()) return driver->open(config, services);
  std::string known;
  for (const InstrumentDriver& each : kInstruments) known += fmt::format(" \"{}\"", each.name);
  return fail(Errc::kInvalidOption,
              "opening the instrument: no instrument is called \"{}\"; set driver to one of{}",
              name,
              known);
}

Result<std::vector<ConnectedInstrument>> connected_instruments() {
  VENEER_ASSIGN(const auto devices, tracking::list_devices(tracking::DeviceClass::kUsb));
  VENEER_ASSIGN(const auto hids, tracking::list_devices(tracking::DeviceClass::kHidraw));
  std::vector<ConnectedInstrument> found;
  const auto add = [&](const tracking::BusDevice& device) {
    const auto known = std::ranges::find(kAppearances, device.id, &Appearance::id);
    // A HID device is listed twice, as what it is on USB and as what hidapi opens.
    const bool is_listed =
        std::ranges::find(found, device.usb_port, &ConnectedInstrument::usb_port) != found.end();
    if (known == kAppearances.end() || is_listed) return;
    found.push_back({std::string(known->model),
                     text_of(device.id),
                     device.usb_port,
                     device.serial,
                     known->driver,
                     std::string(known->remedy)});
  };
  for (const tracking::BusDevice& device : devices) add(device);
  for (const tracking::BusDevice& device : hids) add(device);
  std::ranges::sort(found, {}, &ConnectedInstrument::usb_port);
  return found;
}

}  // namespace veneer::calibration
