// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/kms_output.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "projector/outputs/kms/display_settings.h"
#include "projector/outputs/kms/pixels.h"

namespace veneer::projector {
namespace {

constexpr Duration kBusyPause = std::chrono::milliseconds(1);

std::uint32_t format_of(int bits) { return bits == 10 ? kXrgb2101010 : kXrgb8888; }

/// What the kernel's refusal of a change of the display means.
std::string meaning_of(int error) {
  switch (error) {
    case EACCES:
    case EPERM:
      return "another program is showing its picture on this card";
    case EBUSY:
      return "the card is still busy with an earlier change";
    case EINVAL:
      return "the card's driver refuses this mode with this format; try another mode, bits = 8, or "
             "buffers = \"mapped\"";
    case ENOSPC:
      return "the card has no bandwidth left for it; choose a smaller mode or unplug other "
             "displays";
    case ENOMEM:
      return "the card has no memory left for it";
    case ENODEV:
      return "the card is gone";
    default:
      return std::strerror(error);
  }
}

std::filesystem::path default_state_directory() {
  // systemd may name several, with colons in between.
  const char* folders = std::getenv("STATE_DIRECTORY");
  const std::string_view all = folders == nullptr ? "" : folders;
  return all.substr(0, all.find(':'));
}

}  // namespace

Status KmsOutputOptions::check() const {
  if (bits != 8 && bits != 10)
    return fail(
        Errc::kInvalidOption, "opening the KMS output: bits is {}; 8 and 10 are known", bits);
  return {};
}

Result<std::unique_ptr<KmsOutput>> KmsOutput::open(TomlReader& config,
                                                   const std::filesystem::path& state_directory) {
  KmsOutputOptions options;
  options.state_directory = state_directory.empty() ? default_state_directory() : state_directory;
  std::string buffers = "auto";
  config.read("device", options.device);
  config.read("connector", options.connector);
  config.read("mode", options.mode);
  config.read("bits", options.bits);
  config.read("bits_fallback", options.bits_fallback);
  config.read("buffers", buffers);
  config.read("state_directory", options.state_directory);
  if (buffers == "gpu") {
    options.buffers = KmsOutputOptions::Buffers::kGpu;
  } else if (buffers == "mapped") {
    options.buffers = KmsOutputOptions::Buffers::kMapped;
  } else if (buffers != "auto") {
    return fail(Errc::kInvalidOption,
                "opening the KMS output: buffers is \"{}\"; known are \"auto\", \"gpu\" and "
                "\"mapped\"",
                buffers);
  }
  static SteadyClock clock;
  return open(options, cards_of_this_machine(), clock);
}

Result<std::unique_ptr<KmsOutput>> KmsOutput::open(const KmsOutputOptions& options,
                                                   const KmsCards& cards,
                                                   Clock& clock) {
  VENEER_TRY(options.check());
  // Before any card is touched.
  std::error_code error;
  std::error_code ignored;
  if (!options.state_directory.empty())
    std::filesystem::create_directories(options.state_directory, error);
  if (!options.state_directory.empty() &&
      !std::filesystem::is_directory(options.state_directory, ignored))
    return fail(Errc::kIo,
                "opening the KMS output: the folder {} for the display's colour tables cannot be "
                "made ({}); set state_directory to one that this user may write",
                options.state_directory.string(),
                error.message());
  Result<std::unique_ptr<KmsDevice>> device =
      options.device.empty() ? choose_card(cards, options.connector) : cards.open(options.device);
  if (!device) return fail_while("opening the KMS output", device.error());
  return open(options, std::move(*device), clock);
}

Result<std::unique_ptr<KmsOutput>> KmsOutput::open(const KmsOutputOptions& options,
                                                   std::unique_ptr<KmsDevice> device,
                                                   Clock& clock) {
  VENEER_TRY(options.check());
  std::unique_ptr<KmsOutput> output(new KmsOutput(options, std::move(device), clock));
  if (const Status begun = output->begin(options); !begun)
    return fail_while("opening the KMS output", begun.error());
  return output;
}

KmsOutput::KmsOutput(const KmsOutputOptions& options,
                     std::unique_ptr<KmsDevice> device,
                     Clock& clock)
    : device_(std::move(device)), clock_(clock), keeper_(*device_, options.state_directory) {}

KmsOutput::~KmsOutput() {
  // A frame under way is let through; one that hangs is left to the kernel, which gives up on it.
  if (pending_) static_cast<void>(wait_for_pending());
  std::vector<KmsSetting> black;
  if (framebuffer_property_ != 0)
    black.push_back({display_.plane.id, framebuffer_property_, buffers_[kBlack].framebuffer});
  if (const Status restored = keeper_.restore(std::move(black)); !restored)
    spdlog::error("{}", restored.error().what);
  if (mode_blob_ != 0) device_->destroy_blob(mode_blob_);
}

std::string KmsOutput::doing() const {
  return fmt::format("showing on {} of {}", display_.connector.name, device_->path());
}

Status KmsOutput::begin(const KmsOutputOptions& options) {
  if (const int refused = device_->become_master(); refused != 0)
    return fail(Errc::kUnavailable,
                "another program has {}: a desktop, or another veneerd. Stop it (systemctl stop "
                "display-manager), or switch to a free console; `fuser -v {}` names it",
                device_->path(),
                device_->path());
  VENEER_ASSIGN(display_, choose_display(*device_, options.connector, options.mode));
  by_identity_ = !options.connector.empty() && options.connector != display_.connector.name;
  period_ = from_seconds(1 / display_.mode.refresh_hz);
  VENEER_ASSIGN(mode_blob_, device_->create_blob(display_.mode.bytes));
  VENEER_TRY(choose_bits(options));
  if (options.buffers != KmsOutputOptions::Buffers::kMapped) {
    const Status made = make_buffers(KmsMemory::kGpu);
    if (!made && options.buffers == KmsOutputOptions::Buffers::kGpu)
      return fail(made.error().code, "{}; set buffers to \"mapped\"", made.error().what);
    if (!made) spdlog::warn("{}; pixels are copied instead", made.error().what);
  }
  if (scanout_.buffers.empty()) VENEER_TRY(make_buffers(KmsMemory::kMapped));
  // All that could be refused without a change is behind; now it is saved what will be changed.
  keeper_.restore_leftovers();
  VENEER_TRY(keeper_.keep(display_.connector, display_.crtc));
  return configure(kBlack);
}

Status KmsOutput::choose_bits(const KmsOutputOptions& options) {
  bits_ = options.bits;
  Status possible = make_black(bits_);
  if (possible || bits_ == 8) return possible;
  const std::string refusal =
      fmt::format("{} does not take 10 bits: {}", display_.connector.name, possible.error().what);
  if (!options.bits_fallback)
    return fail(Errc::kUnavailable,
                "{}; set bits to 8, or bits_fallback to true to have this done where needed",
                refusal);
  spdlog::warn("{}; 8 bits are used instead", refusal);
  bits_ = 8;
  return make_black(bits_);
}

Status KmsOutput::make_black(int bits) {
  const std::uint32_t format = format_of(bits);
  if (std::ranges::count(display_.plane.formats, format) == 0)
    return fail(Errc::kUnavailable, "the card scans out no such format");
  VENEER_ASSIGN(const auto properties,
                device_->properties(display_.connector.id, KmsKind::kConnector));
  const KmsProperty* most = find_property(properties, "max bpc");
  if (most != nullptr && most->range && most->range->second < static_cast<std::uint64_t>(bits))
    return fail(Errc::kUnavailable, "its connector sends {} bits at most", most->range->second);
  VENEER_ASSIGN(KmsBuffer black,
                device_->create_buffer(
                    display_.mode.width, display_.mode.height, format, KmsMemory::kMapped));
  const auto settings = full_settings(black.framebuffer, bits);
  Status taken;
  if (!settings) {
    taken = tl::unexpected<Error>(settings.error());
  } else if (const int refused = device_->commit(*settings, KmsCommit::kTest); refused != 0) {
    taken = fail(Errc::kUnavailable, "{}", meaning_of(refused));
  }
  if (!taken) {
    device_->destroy_buffer(black);
    return taken;
  }
  buffers_[kBlack] = black;
  return {};
}

Status KmsOutput::make_buffers(KmsMemory memory) {
  std::array<KmsBuffer, kBuffers> made;
  for (std::size_t i = 0; i < kBuffers; ++i) {
    Result<KmsBuffer> buffer =
        device_->create_buffer(display_.mode.width, display_.mode.height, format_of(bits_), memory);
    Status taken;
    if (!buffer) {
      taken = tl::unexpected<Error>(buffer.error());
    } else {
      made[i] = *buffer;
      // The GPU's memory may lie where this display cannot read it.
      if (const auto settings = full_settings(buffer->framebuffer, bits_); !settings) {
        taken = tl::unexpected<Error>(settings.error());
      } else if (const int refused = device_->commit(*settings, KmsCommit::kTest); refused != 0) {
        taken = fail(Errc::kUnavailable, "{}", meaning_of(refused));
      }
    }
    if (taken) continue;
    for (const KmsBuffer& each : made) {
      if (each.framebuffer != 0) device_->destroy_buffer(each);
    }
    return fail(taken.error().code,
                "making {} buffers for {}: {}",
                memory == KmsMemory::kGpu ? "the GPU's" : "mapped",
                display_.connector.name,
                taken.error().what);
  }
  std::ranges::copy(made, buffers_.begin());
  scanout_.buffers.clear();
  if (memory == KmsMemory::kMapped) return {};
  scanout_.gbm_device = device_->gbm_device();
  for (const KmsBuffer& each : made)
    scanout_.buffers.push_back({each.descriptor,
                                each.width,
                                each.height,
                                each.format,
                                each.stride,
                                each.offset,
                                each.modifier});
  return {};
}

Result<std::vector<KmsSetting>> KmsOutput::full_settings(KmsId framebuffer, int bits) {
  VENEER_ASSIGN(DisplaySettings settings,
                settings_of(*device_, display_, mode_blob_, framebuffer, bits));
  framebuffer_property_ = settings.framebuffer_property;
  return std::move(settings.all);
}

Status KmsOutput::configure(std::size_t buffer) {
  VENEER_ASSIGN(const std::vector<KmsSetting> settings,
                full_settings(buffers_[buffer].framebuffer, bits_));
  if (const int refused = device_->commit(settings, KmsCommit::kFull); refused != 0)
    return trouble_with(refused, "setting the mode");
  VENEER_ASSIGN(const auto of_crtc, device_->properties(display_.crtc, KmsKind::kCrtc));
  if (find_property(of_crtc, "GAMMA_LUT") == nullptr) {
    const std::vector<std::uint16_t> ramp = device_->gamma_ramp(display_.crtc);
    if (!ramp.empty()) {
      if (const int refused = device_->set_gamma_ramp(display_.crtc, neutral_ramp(ramp.size()));
          refused != 0)
        return trouble_with(refused, "switching the gamma ramp off");
    }
  }
  // What was under way is over; its event, if one comes, is known by its token and overlooked.
  pending_.reset();
  shown_ = buffer;
  trouble_ = Trouble::kNone;
  return {};
}

std::string KmsOutput::description() const {
  return fmt::format("{} on {} ({}), {}, {} bits, {}",
                     name_of(display_.connector),
                     device_->path(),
                     device_->driver(),
                     name_of(display_.mode),
                     bits_,
                     scanout_.buffers.empty() ? "pixels copied" : "drawn by the GPU in place");
}

Status KmsOutput::unavailable() const { return fail(Errc::kUnavailable, "{}", trouble_text_); }

Status KmsOutput::trouble_with(int refused, std::string_view what) {
  trouble_text_ = fmt::format("{}: {}: {}", doing(), what, meaning_of(refused));
  if (refused == ENODEV) return fail(Errc::kDisconnected, "{}", trouble_text_);
  next_attempt_ = clock_.now() + kRetryPeriod;
  if (refused == EACCES || refused == EPERM) {
    trouble_ = Trouble::kMaster;
    return unavailable();
  }
  const Result<KmsConnector> now = device_->connector(display_.connector.id, false);
  if (now && !now->connected) {
    trouble_ = Trouble::kUnplugged;
    trouble_text_ = fmt::format("{}: nothing is connected any more", doing());
    return unavailable();
  }
  return fail(Errc::kIo, "{}", trouble_text_);
}

/// Looks after a change whether the display is the same as before.
/// @param ask  the display itself: only then another one in its place is known for what it is.
Status KmsOutput::find_display_again(bool ask) {
  const Result<KmsConnector> found = device_->connector(display_.connector.id, ask);
  if (!found)
    return fail(Errc::kDisconnected,
                "{}: the connector is gone ({}); open the output again",
                doing(),
                found.error().what);
  // After a time without a picture the old one tells of the past.
  const std::size_t buffer = trouble_ == Trouble::kNone ? shown_ : kBlack;
  trouble_ = Trouble::kUnplugged;
  if (!found->connected) {
    trouble_text_ = fmt::format(
        "{}: nothing is connected; switch the projector on and check the cable", doing());
    return unavailable();
  }
  const EdidIdentity identity = read_edid(found->edid);
  if (by_identity_ &&
      (identity.name != display_.identity.name || identity.serial != display_.identity.serial)) {
    trouble_text_ = fmt::format("{}: {} is there now, in place of \"{}\"",
                                doing(),
                                name_of(*found),
                                display_.identity.name);
    return unavailable();
  }
  const bool same_mode = std::ranges::any_of(found->modes, [this](const KmsMode& mode) {
    return name_of(mode) == name_of(display_.mode) && !mode.interlaced;
  });
  if (!same_mode) {
    trouble_text_ = fmt::format(
        "{}: {} offers no {} any more", doing(), name_of(*found), name_of(display_.mode));
    return unavailable();
  }
  return configure(buffer);
}

Status KmsOutput::become_ready() {
  if (broken_) return tl::unexpected<Error>(*broken_);
  const bool changed = device_->changed();
  if (trouble_ == Trouble::kNone) {
    if (!changed) return {};
    const Result<KmsConnector> now = device_->connector(display_.connector.id, false);
    // Another display came or went, or this one went and came between two frames: a mode that is
    // set again costs nothing where nothing was lost.
    if (now && now->connected) VENEER_TRY(wait_for_pending());
  } else if (!changed && clock_.now() < next_attempt_) {
    return unavailable();
  }
  next_attempt_ = clock_.now() + kRetryPeriod;
  if (const int refused = device_->become_master(); refused != 0) {
    if (trouble_ == Trouble::kNone) trouble_ = Trouble::kMaster;
    trouble_text_ = fmt::format("{}: {}", doing(), meaning_of(EACCES));
    return unavailable();
  }
  // Between two frames it may have been exchanged. To ask takes a few frames, which nobody misses
  // then.
  return find_display_again(changed || trouble_ == Trouble::kUnplugged);
}

void KmsOutput::take(const KmsFlip& flip) {
  if (!pending_ || flip.token != pending_->token) return;
  shown_ = pending_->buffer;
  if (pending_->frame) presented_ = Presented{*pending_->frame, flip.time};
  pending_.reset();
}

void KmsOutput::take_flips() {
  while (const std::optional<KmsFlip> flip = device_->wait_flip(Time{})) take(*flip);
}

Status KmsOutput::wait_for_pending() {
  take_flips();
  if (!pending_) return {};
  ++waits_;
  const Time deadline = clock_.now() + kFlipTimeout;
  while (pending_) {
    const std::optional<KmsFlip> flip = device_->wait_flip(deadline);
    if (flip) {
      take(*flip);
    } else if (clock_.now() >= deadline) {
      // Forgotten, so that closing does not wait for it a second time.
      pending_.reset();
      if (const Result<KmsConnector> now = device_->connector(display_.connector.id, false);
          now && !now->connected)
        return trouble_with(EINVAL, "waiting for a frame to appear");
      return fail(Errc::kTimeout,
                  "{}: a frame did not appear within {:.0f} ms; the graphics card hangs (see "
                  "journalctl -k)",
                  doing(),
                  to_seconds(kFlipTimeout) * 1000);
    }
  }
  return {};
}

Status KmsOutput::flip_to(std::size_t buffer, std::optional<std::uint64_t> frame) {
  VENEER_TRY(wait_for_pending());
  const std::array<KmsSetting, 1> settings{
      KmsSetting{display_.plane.id, framebuffer_property_, buffers_[buffer].framebuffer}};
  const std::uint64_t token = next_token_++;
  const Time deadline = clock_.now() + 2 * period_;
  for (;;) {
    const int refused = device_->commit(settings, KmsCommit::kFlip, token);
    if (refused == 0) break;
    if (refused != EBUSY || clock_.now() >= deadline)
      return trouble_with(refused, "handing over a frame");
    clock_.sleep_until(clock_.now() + kBusyPause);
  }
  pending_ = Pending{token, buffer, frame};
  return {};
}

std::size_t KmsOutput::free_buffer() const {
  std::size_t i = 0;
  while (i == shown_ || (pending_ && i == pending_->buffer)) ++i;
  return i;
}

Result<std::size_t> KmsOutput::next_buffer() {
  if (scanout_.buffers.empty())
    return fail(Errc::kUnavailable, "{}: pixels are wanted, not buffers", doing());
  VENEER_TRY(become_ready());
  take_flips();
  return free_buffer();
}

Status KmsOutput::present(const Frame& frame) {
  VENEER_TRY(become_ready());
  take_flips();
  if (frame.bits > bits_)
    return fail(Errc::kInvalidOption,
                "{}: the codes have {} bits, the buffers {}; set bits of [output] to 10, or use a "
                "profile of {} bits",
                doing(),
                frame.bits,
                bits_,
                bits_);
  if (!scanout_.buffers.empty()) {
    if (!frame.buffer || *frame.buffer >= kBuffers || *frame.buffer == shown_ ||
        (pending_ && *frame.buffer == pending_->buffer))
      return fail(Errc::kInvalidOption, "{}: the frame lies in none of the free buffers", doing());
    return flip_to(*frame.buffer, frame.number);
  }
  if (frame.codes.width() != display_.mode.width || frame.codes.height() != display_.mode.height)
    return fail(
        Errc::kInvalidOption,
        "{}: the picture has {} x {} pixels and the mode is {}; set mode of [output] to the "
        "profile's raster",
        doing(),
        frame.codes.width(),
        frame.codes.height(),
        name_of(display_.mode));
  const std::size_t buffer = free_buffer();
  const KmsBuffer& memory = buffers_[buffer];
  write_pixels(frame.codes,
               frame.bits,
               bits_,
               {reinterpret_cast<std::uint32_t*>(memory.pixels),
                memory.width,
                memory.height,
                static_cast<std::ptrdiff_t>(memory.stride / sizeof(std::uint32_t))});
  return flip_to(buffer, frame.number);
}

Status KmsOutput::finish() { return wait_for_pending(); }

Status KmsOutput::blank() {
  VENEER_TRY(become_ready());
  take_flips();
  if (pending_ ? pending_->buffer == kBlack : shown_ == kBlack) return {};
  return flip_to(kBlack, std::nullopt);
}

std::optional<Presented> KmsOutput::last_presented() {
  take_flips();
  return presented_;
}

void KmsOutput::give_up_scanout() {
  if (scanout_.buffers.empty()) return;
  scanout_.buffers.clear();
  scanout_.gbm_device = nullptr;
  // What is on the screen must not be one of the buffers whose numbers are given anew. The old ones
  // stay with the device, which may still be scanning one out.
  const Status dark = blank();
  if (dark) static_cast<void>(wait_for_pending());
  pending_.reset();
  shown_ = kBlack;
  if (const Status made = make_buffers(KmsMemory::kMapped); !made) broken_ = made.error();
}

}  // namespace veneer::projector
