// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/fake_kms_device.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace veneer::projector {
namespace {

const std::vector<std::string>& property_names() {
  static const std::vector<std::string> names{"CRTC_ID",       "FB_ID",
                                              "MODE_ID",       "ACTIVE",
                                              "SRC_X",         "SRC_Y",
                                              "SRC_W",         "SRC_H",
                                              "CRTC_X",        "CRTC_Y",
                                              "CRTC_W",        "CRTC_H",
                                              "type",          "GAMMA_LUT",
                                              "DEGAMMA_LUT",   "CTM",
                                              "Broadcast RGB", "max bpc",
                                              "link-status",   "rotation",
                                              "Colorspace",    "HDR_OUTPUT_METADATA",
                                              "dither",        "dithering mode",
                                              "underscan",     "VRR_ENABLED",
                                              "alpha"};
  return names;
}

std::string text_of(const FakeColours::Table& table) { return {table.bytes.data(), table.size}; }

FakeColours::Table table_of(const std::string& bytes) {
  FakeColours::Table table;
  table.size = std::min(bytes.size(), table.bytes.size());
  std::copy_n(bytes.begin(), table.size, table.bytes.begin());
  return table;
}

constexpr std::uint64_t kOpaque = 0xffff;
constexpr std::uint64_t kPrimary = 1;
constexpr std::uint64_t kCursor = 2;

}  // namespace

std::string fake_edid(const std::string& name, const std::string& serial, std::uint32_t number) {
  std::string edid(128, '\0');
  edid.replace(0, 8, std::string("\x00\xff\xff\xff\xff\xff\xff\x00", 8));
  // "SEC": 19, 5 and 3 in five bits each.
  constexpr unsigned kLetters = (19U << 10U) | (5U << 5U) | 3U;
  edid[8] = static_cast<char>(kLetters >> 8U);
  edid[9] = static_cast<char>(kLetters & 0xffU);
  for (std::size_t i = 0; i < 4; ++i) edid[12 + i] = static_cast<char>(number >> (8 * i));
  const auto describe = [&edid](std::size_t at, char tag, std::string text) {
    edid[at + 3] = tag;
    text += '\n';
    text.resize(13, ' ');
    edid.replace(at + 5, 13, text);
  };
  edid[54] = 1;  // a timing, to be passed over
  if (!name.empty()) describe(72, '\xfc', name);
  if (!serial.empty()) describe(90, '\xff', serial);
  unsigned sum = 0;
  for (const char c : edid) sum += static_cast<unsigned char>(c);
  edid[127] = static_cast<char>(256 - sum % 256);
  return edid;
}

KmsMode fake_mode(int width, int height, double refresh_hz, bool preferred) {
  KmsMode mode;
  mode.bytes = fmt::format("{} {} {}", width, height, refresh_hz);
  mode.width = width;
  mode.height = height;
  mode.refresh_hz = refresh_hz;
  mode.preferred = preferred;
  return mode;
}

FakeKmsDevice::FakeKmsDevice(FakeCard& card, VirtualClock& clock)
    : card_(card), clock_(clock), master_(!card.other_master) {
  for (std::size_t i = 0; i < card.connectors.size(); ++i) {
    const KmsId id = connector_id(i);
    values_[{id, "CRTC_ID"}] = 0;
    values_[{id, "link-status"}] = 0;
    values_[{id, "Broadcast RGB"}] = 0;
    if (card.extras) {
      for (const char* name :
           {"Colorspace", "HDR_OUTPUT_METADATA", "dither", "dithering mode", "underscan"})
        values_[{id, name}] = 0;
    }
    if (card.most_bits) values_[{id, "max bpc"}] = *card.most_bits;
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(card.crtcs); ++i) {
    values_[{crtc_id(i), "MODE_ID"}] = 0;
    values_[{crtc_id(i), "ACTIVE"}] = 0;
    if (card.extras) values_[{crtc_id(i), "VRR_ENABLED"}] = 1;  // as another program left it
    if (card.tables) {
      for (const char* name : {"GAMMA_LUT", "DEGAMMA_LUT", "CTM"}) values_[{crtc_id(i), name}] = 0;
    }
    for (const KmsId plane : {primary_id(i), cursor_id(i)}) {
      values_[{plane, "type"}] = plane == primary_id(i) ? kPrimary : kCursor;
      for (const std::string& name : property_names()) {
        if (name == "CRTC_ID" || name == "FB_ID" || name.starts_with("SRC_") ||
            name.starts_with("CRTC_"))
          values_[{plane, name}] = 0;
      }
      values_[{plane, "rotation"}] = 4;  // upside down, as another program left it
      if (card.extras) values_[{plane, "alpha"}] = kOpaque / 3;  // likewise
    }
  }
  if (card.hardware == nullptr) return;
  const FakeColours& found = card.hardware->colours();
  const auto load = [this](KmsId object, const char* name, const FakeColours::Table& table) {
    if (table.size == 0) return;
    blobs_[next_id_] = text_of(table);
    values_[{object, name}] = next_id_++;
  };
  if (card.tables) {
    load(crtc_id(0), "GAMMA_LUT", found.gamma);
    load(crtc_id(0), "DEGAMMA_LUT", found.degamma);
    load(crtc_id(0), "CTM", found.matrix);
  }
  if (card.extras) {
    load(connector_id(0), "HDR_OUTPUT_METADATA", found.hdr);
    values_[{connector_id(0), "Colorspace"}] = found.colorspace;
    values_[{connector_id(0), "dither"}] = found.dither;
    values_[{connector_id(0), "dithering mode"}] = found.dithering_mode;
    values_[{connector_id(0), "underscan"}] = found.underscan;
  }
  values_[{connector_id(0), "Broadcast RGB"}] = found.broadcast;
  if (card.most_bits) values_[{connector_id(0), "max bpc"}] = found.max_bits;
}

FakeKmsDevice::~FakeKmsDevice() {
  for (const Memory& memory : memories_) {
    ::munmap(memory.bytes, memory.size);
    if (memory.buffer.descriptor >= 0) ::close(memory.buffer.descriptor);
  }
}

void FakeKmsDevice::called() {
  if (card_.before_call) card_.before_call();
  advance();
}

KmsId FakeKmsDevice::property_id(const std::string& name) {
  const auto found = std::ranges::find(property_names(), name);
  return static_cast<KmsId>(found - property_names().begin()) + 1;
}

std::uint64_t FakeKmsDevice::value(KmsId object, const std::string& name) const {
  return values_.at({object, name});
}
void FakeKmsDevice::set_value(KmsId object, const std::string& name, std::uint64_t value) {
  values_[{object, name}] = value;
}

const FakeKmsDevice::Memory* FakeKmsDevice::memory(KmsId framebuffer) const {
  for (const Memory& each : memories_) {
    if (each.buffer.framebuffer == framebuffer) return &each;
  }
  return nullptr;
}

std::string FakeKmsDevice::contents(KmsId framebuffer) const {
  const Memory* found = memory(framebuffer);
  return found == nullptr ? "" : std::string(reinterpret_cast<char*>(found->bytes), found->size);
}

Image<Rgb16> FakeKmsDevice::screen(std::size_t connector) {
  advance();
  const auto crtc = static_cast<KmsId>(value(connector_id(connector), "CRTC_ID"));
  if (crtc == 0 || value(crtc, "ACTIVE") == 0 || !card_.connectors[connector].connected) return {};
  for (std::size_t i = 0; i < static_cast<std::size_t>(card_.crtcs); ++i) {
    const KmsId plane = primary_id(i);
    const Memory* found = memory(static_cast<KmsId>(value(plane, "FB_ID")));
    if (value(plane, "CRTC_ID") != crtc || found == nullptr) continue;
    const KmsBuffer& buffer = found->buffer;
    const unsigned bits = buffer.format == kXrgb2101010 ? 10 : 8;
    const unsigned full = (1U << bits) - 1;
    Image<Rgb16> image(buffer.width, buffer.height);
    for (int y = 0; y < buffer.height; ++y) {
      for (int x = 0; x < buffer.width; ++x) {
        std::uint32_t word = 0;
        std::memcpy(&word,
                    found->bytes + static_cast<std::size_t>(y) * buffer.stride +
                        4 * static_cast<std::size_t>(x),
                    4);
        image(x, y) = {static_cast<std::uint16_t>(word >> (2 * bits) & full),
                       static_cast<std::uint16_t>(word >> bits & full),
                       static_cast<std::uint16_t>(word & full)};
      }
    }
    return image;
  }
  return {};
}

Result<KmsResources> FakeKmsDevice::resources() {
  called();
  if (card_.gone) return fail(Errc::kDisconnected, "the fake card is gone");
  KmsResources found;
  for (std::size_t i = 0; i < card_.connectors.size(); ++i)
    found.connectors.push_back(connector_id(i));
  for (std::size_t i = 0; i < static_cast<std::size_t>(card_.crtcs); ++i) {
    found.crtcs.push_back(crtc_id(i));
    found.planes.push_back({cursor_id(i), {crtc_id(i)}, {}});
    found.planes.push_back({primary_id(i), {crtc_id(i)}, card_.formats});
  }
  return found;
}

Result<KmsConnector> FakeKmsDevice::connector(KmsId id, bool probe) {
  called();
  const std::size_t i = id - connector_id(0);
  if (card_.gone || i >= card_.connectors.size())
    return fail(Errc::kDisconnected, "the fake card has no connector {}", id);
  const FakeConnector& fake = card_.connectors[i];
  KmsConnector found;
  found.id = id;
  found.name = fake.name;
  found.connected = fake.connected;
  Known& known = known_[id];
  if (probe && master_ && !card_.other_master)
    known = fake.connected ? Known{fake.modes, fake.edid} : Known{};
  found.modes = known.modes;
  found.edid = known.edid;
  for (std::size_t k = 0; k < static_cast<std::size_t>(card_.crtcs); ++k)
    found.possible_crtcs.push_back(crtc_id(k));
  return found;
}

Result<std::vector<KmsProperty>> FakeKmsDevice::properties(KmsId object, KmsKind /*kind*/) {
  called();
  std::vector<KmsProperty> found;
  for (const auto& [key, value] : values_) {
    if (key.first != object) continue;
    KmsProperty property;
    property.id = property_id(key.second);
    property.name = key.second;
    property.value = value;
    const std::string& name = key.second;
    property.is_blob = name == "MODE_ID" || name == "GAMMA_LUT" || name == "DEGAMMA_LUT" ||
                       name == "CTM" || name == "HDR_OUTPUT_METADATA";
    if (name == "type") property.choices = {{"Overlay", 0}, {"Primary", 1}, {"Cursor", 2}};
    if (name == "Broadcast RGB")
      property.choices = {{"Automatic", 0}, {"Full", 1}, {"Limited 16:235", 2}};
    if (name == "Colorspace") property.choices = {{"BT2020_RGB", 9}, {"Default", 0}};
    if (name == "dither") property.choices = {{"on", 1}, {"off", 0}};
    if (name == "dithering mode")
      property.choices = {{"auto", 0}, {"off", 1}, {"static 2x2", 2}, {"dynamic 2x2", 3}};
    if (name == "underscan") property.choices = {{"off", 0}, {"on", 1}, {"auto", 2}};
    if (name == "alpha") property.range.emplace(0, kOpaque);
    if (name == "link-status") property.choices = {{"Good", 0}, {"Bad", 1}};
    if (name == "rotation") property.choices = {{"rotate-0", 0}, {"rotate-180", 2}};
    if (name == "max bpc") property.range.emplace(6, *card_.most_bits);
    found.push_back(std::move(property));
  }
  if (found.empty()) return fail(Errc::kUnavailable, "the fake card has no object {}", object);
  return found;
}

Result<std::string> FakeKmsDevice::blob(KmsId id) {
  called();
  const auto found = blobs_.find(id);
  if (found == blobs_.end()) return fail(Errc::kUnavailable, "the fake card has no blob {}", id);
  return found->second;
}
Result<KmsId> FakeKmsDevice::create_blob(std::string_view bytes) {
  called();
  blobs_[next_id_] = bytes;
  ++caller_blobs_;
  return next_id_++;
}
void FakeKmsDevice::destroy_blob(KmsId /*id*/) {
  called();
  --caller_blobs_;  // the bytes stay: they may be in use, which the kernel would know
}

int FakeKmsDevice::check(const Values& values) const {
  const auto at = [&values](KmsId object, const char* name) { return values.at({object, name}); };
  for (std::size_t i = 0; i < static_cast<std::size_t>(card_.crtcs); ++i) {
    const KmsId plane = primary_id(i);
    const auto crtc = static_cast<KmsId>(at(plane, "CRTC_ID"));
    const auto framebuffer = static_cast<KmsId>(at(plane, "FB_ID"));
    if ((crtc == 0) != (framebuffer == 0)) return EINVAL;
    if (crtc == 0) continue;
    const Memory* found = memory(framebuffer);
    if (found == nullptr) return EINVAL;
    const KmsBuffer& buffer = found->buffer;
    if (std::ranges::count(card_.formats, buffer.format) == 0) return EINVAL;
    const auto width = static_cast<std::uint64_t>(buffer.width);
    const auto height = static_cast<std::uint64_t>(buffer.height);
    if (at(plane, "SRC_W") != width << 16U || at(plane, "SRC_H") != height << 16U ||
        at(plane, "CRTC_W") != width || at(plane, "CRTC_H") != height)
      return EINVAL;
    const auto mode = blobs_.find(static_cast<KmsId>(at(crtc, "MODE_ID")));
    if (at(crtc, "ACTIVE") != 0 &&
        (mode == blobs_.end() || !mode->second.starts_with(fmt::format("{} {} ", width, height))))
      return EINVAL;
  }
  for (std::size_t i = 0; i < card_.connectors.size() && card_.most_bits; ++i) {
    const std::uint64_t bits = at(connector_id(i), "max bpc");
    if (bits < 6 || bits > *card_.most_bits) return EINVAL;
  }
  return 0;
}

void FakeKmsDevice::keep_colours(const Values& values) {
  if (card_.hardware == nullptr) return;
  FakeColours colours = card_.hardware->colours();
  const auto table = [&](KmsId object, const char* name) {
    const auto id = static_cast<KmsId>(values.at({object, name}));
    return id == 0 ? FakeColours::Table{} : table_of(blobs_.at(id));
  };
  if (card_.tables) {
    colours.gamma = table(crtc_id(0), "GAMMA_LUT");
    colours.degamma = table(crtc_id(0), "DEGAMMA_LUT");
    colours.matrix = table(crtc_id(0), "CTM");
  }
  if (card_.extras) {
    colours.hdr = table(connector_id(0), "HDR_OUTPUT_METADATA");
    colours.colorspace = values.at({connector_id(0), "Colorspace"});
    colours.dither = values.at({connector_id(0), "dither"});
    colours.dithering_mode = values.at({connector_id(0), "dithering mode"});
    colours.underscan = values.at({connector_id(0), "underscan"});
  }
  colours.broadcast = values.at({connector_id(0), "Broadcast RGB"});
  if (card_.most_bits) colours.max_bits = values.at({connector_id(0), "max bpc"});
  if (colours == card_.hardware->colours()) return;
  if (card_.before_colour_change) card_.before_colour_change();
  card_.hardware->set(colours);
}

void FakeKmsDevice::apply(const Values& values) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(card_.crtcs); ++i) {
    const auto leaves = static_cast<KmsId>(values_.at({primary_id(i), "FB_ID"}));
    const auto promised = promised_.find(leaves);
    if (leaves == values.at({primary_id(i), "FB_ID"}) || promised == promised_.end()) continue;
    if (promised->second != contents(leaves)) ++card_.torn;
    promised_.erase(promised);
  }
  values_ = values;
}

int FakeKmsDevice::commit(std::span<const KmsSetting> settings,
                          KmsCommit how,
                          std::uint64_t token) {
  called();
  if (card_.gone) return ENODEV;
  if (card_.other_master) master_ = false;
  if (!master_) return EACCES;
  if (card_.refuse) {
    if (const int refused = card_.refuse(how); refused != 0) return refused;
  }
  if (waiting_ && how == KmsCommit::kFlip) return EBUSY;
  if (waiting_ && how == KmsCommit::kFull) {
    clock_.sleep_until(card_.hangs ? clock_.now() + std::chrono::seconds(10) : waiting_->time);
    advance();
    waiting_.reset();
  }
  Values wanted = values_;
  for (const KmsSetting& each : settings) {
    if (each.property == 0 || each.property > property_names().size()) return ENOENT;
    const std::string& name = property_names()[each.property - 1];
    const auto found = wanted.find({each.object, name});
    if (found == wanted.end()) return ENOENT;
    if (how == KmsCommit::kFlip && name != "FB_ID") return EINVAL;  // would be a change of modes
    found->second = each.value;
  }
  if (const int refused = check(wanted); refused != 0) return refused;
  if (how == KmsCommit::kTest) return 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(card_.crtcs); ++i) {
    const auto framebuffer = static_cast<KmsId>(wanted.at({primary_id(i), "FB_ID"}));
    if (framebuffer == 0) continue;
    const std::string now = contents(framebuffer);
    const auto [promised, first] = promised_.emplace(framebuffer, now);
    if (!first && promised->second != now) ++card_.torn;
    promised->second = now;
  }
  if (how == KmsCommit::kFlip) {
    const auto retraces = clock_.now().time_since_epoch() / card_.period + 1;
    waiting_ = Waiting{token, Time(retraces * card_.period), std::move(wanted)};
    return 0;
  }
  ++card_.full_commits;
  keep_colours(wanted);
  apply(wanted);
  return 0;
}

void FakeKmsDevice::advance() {
  if (!waiting_ || card_.hangs || clock_.now() < waiting_->time) return;
  apply(waiting_->values);
  const auto sequence =
      static_cast<std::uint32_t>(waiting_->time.time_since_epoch() / card_.period);
  flips_.push_back({waiting_->token, sequence, waiting_->time});
  waiting_.reset();
}

std::optional<KmsFlip> FakeKmsDevice::wait_flip(Time until) {
  called();
  if (flips_.empty()) {
    const bool comes = waiting_ && !card_.hangs && waiting_->time <= until;
    clock_.sleep_until(comes ? waiting_->time : until);
    advance();
  }
  if (flips_.empty()) return std::nullopt;
  const KmsFlip flip = flips_.front();
  flips_.pop_front();
  return flip;
}

std::vector<std::uint16_t> FakeKmsDevice::gamma_ramp(KmsId /*crtc*/) {
  called();
  if (card_.hardware == nullptr) return {};
  const auto& ramp = card_.hardware->colours().ramp;
  return {ramp.begin(), ramp.end()};
}
int FakeKmsDevice::set_gamma_ramp(KmsId /*crtc*/, std::span<const std::uint16_t> ramp) {
  called();
  if (card_.other_master || !master_) return EACCES;
  FakeColours colours = card_.hardware->colours();
  if (ramp.size() != colours.ramp.size()) return EINVAL;
  std::ranges::copy(ramp, colours.ramp.begin());
  if (card_.before_colour_change) card_.before_colour_change();
  card_.hardware->set(colours);
  return 0;
}

Result<KmsBuffer> FakeKmsDevice::create_buffer(int width,
                                               int height,
                                               std::uint32_t format,
                                               KmsMemory kind) {
  called();
  if (kind == KmsMemory::kGpu && !card_.gpu)
    return fail(Errc::kUnavailable, "the fake card has no GPU");
  Memory made;
  made.buffer.width = width;
  made.buffer.height = height;
  made.buffer.format = format;
  made.buffer.stride = static_cast<std::uint32_t>(4 * width + 64);  // rows are padded
  made.size = static_cast<std::size_t>(made.buffer.stride) * static_cast<std::size_t>(height);
  const bool shared = kind == KmsMemory::kGpu;
  if (shared) {
    made.buffer.descriptor = ::memfd_create("fake-gpu", MFD_CLOEXEC);
    VENEER_CHECK(::ftruncate(made.buffer.descriptor, static_cast<off_t>(made.size)) == 0);
  }
  void* memory = ::mmap(nullptr,
                        made.size,
                        PROT_READ | PROT_WRITE,
                        shared ? MAP_SHARED : MAP_PRIVATE | MAP_ANONYMOUS,
                        made.buffer.descriptor,
                        0);
  VENEER_CHECK(memory != MAP_FAILED);
  made.bytes = static_cast<std::byte*>(memory);
  if (!shared) made.buffer.pixels = made.bytes;
  made.buffer.framebuffer = next_id_++;
  memories_.push_back(made);
  return made.buffer;
}

void FakeKmsDevice::destroy_buffer(const KmsBuffer& buffer) {
  called();
  std::erase_if(memories_, [&buffer](const Memory& memory) {
    if (memory.buffer.framebuffer != buffer.framebuffer) return false;
    ::munmap(memory.bytes, memory.size);
    if (buffer.descriptor >= 0) ::close(buffer.descriptor);
    return true;
  });
}

int FakeKmsDevice::become_master() {
  called();
  ++card_.masters_asked;
  if (card_.other_master) return EBUSY;
  master_ = true;
  return 0;
}

bool FakeKmsDevice::changed() {
  called();
  return std::exchange(card_.changed, false);
}

}  // namespace veneer::projector
