// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "capture/cameras/aravis/internal_discovery.h"
#include "capture/cameras/aravis/internal_state.h"
#include "capture/cameras/layout.h"

// Opening a camera, and what is set before its pictures are grabbed.
namespace veneer::capture {
namespace {

constexpr int kBuffers = 4;  // one is filled, one read; the others for what comes late

}  // namespace

Status AravisCamera::State::start(const AravisOptions& wanted) {
  options = wanted;
  ArvDevice* device = arv_camera_get_device(camera.get());
  lost_handler = g_signal_connect(device, "control-lost", G_CALLBACK(&on_control_lost), this);
  GlibError error;
  const char* vendor = arv_camera_get_vendor_name(camera.get(), error.out());
  const std::string maker = vendor == nullptr ? "unknown" : vendor;
  const char* model = arv_camera_get_model_name(camera.get(), error.out());
  description = fmt::format("aravis: {} {}", maker, model == nullptr ? "camera" : model);
  const char* serial = arv_camera_get_device_serial_number(camera.get(), error.out());
  if (serial != nullptr) description += fmt::format(" {}", serial);

  VENEER_TRY(switch_off_automatics());
  VENEER_TRY(set_packets());
  if (options.gain_raw) VENEER_TRY(set_raw_gain(*options.gain_raw));

  single_frame = arv_camera_is_enumeration_entry_available(
                     camera.get(), "AcquisitionMode", "SingleFrame", error.out()) != FALSE &&
                 !error;
  arv_camera_set_acquisition_mode(
      camera.get(),
      single_frame ? ARV_ACQUISITION_MODE_SINGLE_FRAME : ARV_ACQUISITION_MODE_CONTINUOUS,
      error.out());
  if (error) return failed("choosing single pictures", error);
  arv_camera_clear_triggers(camera.get(), error.out());
  if (error) return failed("switching its triggers off", error);

  exposure_s = 1e-6 * arv_camera_get_exposure_time(camera.get(), error.out());
  if (error) return failed("reading the exposure", error);
  const std::vector<std::string> names = formats();
  if (names.empty()) {
    return fail(
        Errc::kUnavailable,
        "{}: it has no pixel format that can be read here: Mono, Bayer, Polarized of 8 to 16 "
        "bits, or RGB8",
        description);
  }
  return choose_format(names.front());
}

/// A picture must depend on the light and the exposure alone, and in proportion.
Status AravisCamera::State::switch_off_automatics() {
  GlibError error;
  for (const char* feature : {"ExposureAuto", "GainAuto", "BalanceWhiteAuto", "BlackLevelAuto"}) {
    if (!has(feature)) continue;
    arv_camera_set_string(camera.get(), feature, "Off", error.out());
    if (error) return failed(fmt::format("switching {} off", feature), error);
  }
  // A rate that was asked for bounds the exposure.
  for (const char* feature : {"AcquisitionFrameRateEnable", "GammaEnable", "LUTEnable"}) {
    if (!has(feature)) continue;
    arv_camera_set_boolean(camera.get(), feature, FALSE, error.out());
    if (error) return failed(fmt::format("switching {} off", feature), error);
  }
  if (!has("GammaEnable") && has("Gamma")) {
    arv_camera_set_float(camera.get(), "Gamma", 1, error.out());
    if (error) return failed("setting Gamma to 1", error);
  }
  return {};
}

Status AravisCamera::State::set_packets() {
  if (!is_ethernet()) return {};
  GlibError error;
  if (options.packet_size != 0) {
    arv_camera_gv_set_packet_size(camera.get(), options.packet_size, error.out());
    if (error) return failed(fmt::format("setting packet_size to {}", options.packet_size), error);
  }
  if (options.packet_delay_us >= 0) {
    arv_camera_gv_set_packet_delay(
        camera.get(),
        static_cast<gint64>(std::llround(1000 * options.packet_delay_us)),
        error.out());
    if (error) {
      return failed(fmt::format("setting packet_delay_us to {}", options.packet_delay_us), error);
    }
  }
  return {};
}

Status AravisCamera::State::set_raw_gain(int steps) {
  if (!has("GainRaw")) {
    return fail(Errc::kUnavailable,
                "{}: it does not count its gain in steps; set gain_db in place of gain_raw",
                description);
  }
  GlibError error;
  gint64 least = 0;
  gint64 most = 0;
  arv_camera_get_integer_bounds(camera.get(), "GainRaw", &least, &most, error.out());
  if (error) return failed("reading the range of GainRaw", error);
  if (steps < least || steps > most) {
    return fail(Errc::kInvalidOption,
                "{}: gain_raw is {}; it must be {} to {}",
                description,
                steps,
                least,
                most);
  }
  arv_camera_set_integer(camera.get(), "GainRaw", steps, error.out());
  if (error) return failed("setting gain_raw", error);
  return {};
}

std::vector<std::string> AravisCamera::State::formats() {
  GlibError error;
  guint count = 0;
  const GMemory<const char*> names(
      arv_camera_dup_available_pixel_formats_as_strings(camera.get(), &count, error.out()));
  std::vector<std::string> readable;
  if (error || names == nullptr) return readable;
  for (const char* name : std::span(names.get(), count)) {
    if (pixel_format_named(name)) readable.emplace_back(name);
  }
  const char* present = arv_camera_get_pixel_format_as_string(camera.get(), error.out());
  if (present != nullptr && !error) {
    const auto at = std::ranges::find(readable, present);
    if (at != readable.end()) std::rotate(readable.begin(), at, at + 1);
  }
  return readable;
}

Status AravisCamera::State::choose_format(const std::string& name) {
  const std::vector<std::string> known = formats();
  if (std::ranges::find(known, name) == known.end()) {
    return fail(
        Errc::kInvalidOption,
        "{}: it has no pixel format \"{}\" that can be read here; set pixel_format to one of "
        "{}",
        description,
        name,
        fmt::join(known, ", "));
  }
  PixelFormat chosen = *pixel_format_named(name);
  if (options.layout != Mosaic::kNone) {
    const bool colour = chosen.colours != PixelFormat::Colours::kGrey;
    // The colours of a mosaic's cells are R G; G B, and a mirrored picture has them otherwise.
    if (colour &&
        (options.layout != Mosaic::kPolarColour || chosen.colours != PixelFormat::Colours::kRggb)) {
      return fail(
          Errc::kInvalidOption,
          "{}: the pixel format {} does not fit the layout; set pixel_format to a Mono format "
          "for \"polarsens-mono\", to BayerRG for \"polarsens-colour\" (ReverseX and ReverseY "
          "off), or leave layout out",
          description,
          name);
    }
    chosen.colours = PixelFormat::Colours::kGrey;
    chosen.mosaic = options.layout;
  }
  GlibError error;
  arv_camera_set_pixel_format_from_string(camera.get(), name.c_str(), error.out());
  if (error) return failed(fmt::format("setting pixel_format to {}", name), error);
  int x = 0;
  int y = 0;
  arv_camera_get_region(camera.get(), &x, &y, &width, &height, error.out());
  if (error) return failed("reading the size of its pictures", error);
  if (const Status whole = check_layout(chosen.mosaic, width, height); !whole) {
    return fail_while(description, whole.error());
  }
  const int cell = cell_size(chosen.mosaic);
  if (x % cell != 0 || y % cell != 0) {
    return fail(
        Errc::kInvalidOption,
        "{}: its pictures begin at pixel ({}, {}) of the sensor, within a cell of the layout; "
        "set OffsetX and OffsetY to multiples of {} with the maker's viewer",
        description,
        x,
        y,
        cell);
  }
  format = chosen;
  format_name = name;
  return make_stream();
}

Status AravisCamera::State::make_stream() {
  stream.reset();  // its socket, before the next one's
  GlibError error;
  const guint payload = arv_camera_get_payload(camera.get(), error.out());
  if (error) return failed("reading the size of its pictures", error);
  stream.reset(arv_camera_create_stream(camera.get(), nullptr, nullptr, error.out()));
  if (error || stream == nullptr) return failed("opening its stream", error);
  for (int i = 0; i < kBuffers; ++i) {
    arv_stream_push_buffer(stream.get(), arv_buffer_new_allocate(payload));
  }
  return {};
}

AravisCamera::AravisCamera(std::unique_ptr<State> state) : state_(std::move(state)) {}
AravisCamera::~AravisCamera() = default;

Result<std::unique_ptr<AravisCamera>> AravisCamera::open(TomlReader& config) {
  std::string name;
  std::string address;
  config.read("name", name);
  config.read("address", address);
  VENEER_ASSIGN(const AravisOptions options, AravisOptions::read(config));
  auto state = std::make_unique<State>();
  VENEER_ASSIGN(state->camera, open_device(name, address));
  VENEER_TRY(state->start(options));
  return std::unique_ptr<AravisCamera>(new AravisCamera(std::move(state)));
}

Result<std::vector<CameraInfo>> AravisCamera::list() { return discover_cameras(); }

std::string AravisCamera::description() const { return state_->description; }
int AravisCamera::width() const { return state_->width; }
int AravisCamera::height() const { return state_->height; }

ExposureRange AravisCamera::exposure_range() const {
  GlibError error;
  double least_us = 0;
  double most_us = 0;
  arv_camera_get_exposure_time_bounds(state_->camera.get(), &least_us, &most_us, error.out());
  if (error) return {};
  return {1e-6 * least_us, 1e-6 * most_us};
}

Status AravisCamera::set_exposure(double seconds) {
  State& s = *state_;
  if (s.lost) return s.disconnected();
  GlibError error;
  double least_us = 0;
  double most_us = 0;
  arv_camera_get_exposure_time_bounds(s.camera.get(), &least_us, &most_us, error.out());
  if (error) return s.failed("reading the range of the exposure", error);
  // The negation refuses NaN, too; the factor lets through what was rounded on its way.
  constexpr double kRounding = 1e-9;
  if (!(1e6 * seconds >= least_us * (1 - kRounding) &&
        1e6 * seconds <= most_us * (1 + kRounding))) {
    return fail(Errc::kInvalidOption,
                "{}: an exposure of {} s is out of its range, {:.6g} to {:.6g} s",
                s.description,
                seconds,
                1e-6 * least_us,
                1e-6 * most_us);
  }
  arv_camera_set_exposure_time(
      s.camera.get(), std::clamp(1e6 * seconds, least_us, most_us), error.out());
  if (error) return s.failed("setting the exposure", error);
  const double got_us = arv_camera_get_exposure_time(s.camera.get(), error.out());
  if (error) return s.failed("reading the exposure", error);
  s.exposure_s = 1e-6 * got_us;
  return {};
}

Status AravisCamera::set_gain_db(double gain) {
  State& s = *state_;
  if (s.lost) return s.disconnected();
  // GainRaw, which older cameras have alone, is in steps of their own.
  if (!s.has("Gain") && !s.has("GainAbs")) {
    return fail(Errc::kUnavailable,
                "{}: its gain is not known in decibels; {}",
                s.description,
                s.has("GainRaw") ? "set gain_raw, in its own steps, in place of gain_db"
                                 : "leave gain_db out");
  }
  GlibError error;
  double least = 0;
  double most = 0;
  arv_camera_get_gain_bounds(s.camera.get(), &least, &most, error.out());
  if (error) return s.failed("reading the range of the gain", error);
  if (!(gain >= least && gain <= most)) {
    return fail(Errc::kInvalidOption,
                "{}: a gain of {} dB is out of its range, {} to {} dB",
                s.description,
                gain,
                least,
                most);
  }
  arv_camera_set_gain(s.camera.get(), gain, error.out());
  if (error) return s.failed("setting the gain", error);
  return {};
}

std::vector<std::string> AravisCamera::pixel_formats() const { return state_->formats(); }

Status AravisCamera::set_pixel_format(std::string_view name) {
  if (state_->lost) return state_->disconnected();
  return state_->choose_format(std::string(name));
}

Status AravisCamera::set_trigger(Trigger trigger) {
  State& s = *state_;
  if (s.lost) return s.disconnected();
  GlibError error;
  if (trigger == Trigger::kFree) {
    arv_camera_clear_triggers(s.camera.get(), error.out());
    if (error) return s.failed("switching its triggers off", error);
    s.trigger = trigger;
    return {};
  }
  const auto fits = [&](std::string_view source) {
    return trigger == Trigger::kSoftware ? source == "Software" : source.starts_with("Line");
  };
  std::string source;
  // The line that the camera is set to is more likely the wired one than the first.
  const char* present = arv_camera_get_trigger_source(s.camera.get(), error.out());
  if (present != nullptr && !error && fits(present)) source = present;
  guint count = 0;
  const GMemory<const char*> names(
      arv_camera_dup_available_trigger_sources(s.camera.get(), &count, error.out()));
  for (const char* each : std::span(names.get(), error || names == nullptr ? 0 : count)) {
    if (source.empty() && fits(each)) source = each;
  }
  if (source.empty()) {
    return fail(Errc::kUnavailable,
                "{}: it has no {} trigger; set trigger to \"free\" or leave it out",
                s.description,
                trigger == Trigger::kSoftware ? "software" : "hardware");
  }
  arv_camera_set_trigger(s.camera.get(), source.c_str(), error.out());
  if (error) return s.failed(fmt::format("setting the trigger to {}", source), error);
  s.trigger = trigger;
  return {};
}

}  // namespace veneer::capture
