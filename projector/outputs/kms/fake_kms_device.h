// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "projector/outputs/kms/kms_device.h"

namespace veneer::projector {

/// What stays in a card when the program that set it is gone. Plain memory, so that processes can
/// share it; a change is seen whole or not at all, as the kernel's are.
struct FakeColours {
  struct Table {
    std::array<char, 2048> bytes{};
    std::size_t size = 0;
    bool operator==(const Table&) const = default;
  };
  Table gamma, degamma, matrix, hdr;
  std::uint64_t broadcast = 0;
  std::uint64_t max_bits = 12;
  std::uint64_t colorspace = 0;
  std::uint64_t dither = 0;          // radeon's
  std::uint64_t dithering_mode = 0;  // nouveau's
  std::uint64_t underscan = 0;
  std::array<std::uint16_t, 768> ramp{};
  bool operator==(const FakeColours&) const = default;
};
class FakeHardware {
 public:
  [[nodiscard]] const FakeColours& colours() const { return slots_[current_.load()]; }
  void set(const FakeColours& colours) {
    const unsigned next = 1 - current_.load();
    slots_[next] = colours;
    current_.store(next);
  }

 private:
  std::array<FakeColours, 2> slots_{};
  std::atomic<unsigned> current_{0};
};

struct FakeConnector {
  std::string name;
  std::string edid;
  bool connected = true;
  std::vector<KmsMode> modes;
};

/// A card that a test arranges, with its faults; outlives the devices that open it.
struct FakeCard {
  std::string path = "/dev/dri/card7";
  FakeHardware* hardware = nullptr;
  std::vector<FakeConnector> connectors;
  int crtcs = 2;
  std::vector<std::uint32_t> formats{kXrgb8888, kXrgb2101010};
  bool tables = true;  ///< GAMMA_LUT, DEGAMMA_LUT and CTM; else a ramp alone
  bool extras =
      true;  ///< what only some drivers have: Colorspace, HDR, dither, underscan, VRR, alpha
  std::optional<std::uint64_t> most_bits = 12;  ///< of "max bpc"; none: no such property
  bool gpu = false;
  Duration period = std::chrono::microseconds(16'667);

  bool other_master = false;  ///< another program has the card
  bool gone = false;
  bool hangs = false;    ///< flips never come
  bool changed = false;  ///< an event of udev waits
  /// The errno for a commit, 0 to let it be.
  std::function<int(KmsCommit)> refuse;
  std::function<void()> before_call;           ///< of whatever kind
  std::function<void()> before_colour_change;  ///< of the hardware's

  int torn = 0;  ///< buffers that were written while they were to be shown
  int full_commits = 0;
  int masters_asked = 0;
};

/// A monitor's EDID with these texts.
[[nodiscard]] std::string fake_edid(const std::string& name,
                                    const std::string& serial,
                                    std::uint32_t number = 0);
[[nodiscard]] KmsMode fake_mode(int width, int height, double refresh_hz, bool preferred = false);

/// A KmsDevice on a virtual clock, with retraces at multiples of the period, that takes what the
/// kernel takes and refuses what it refuses. A change of what is plugged in is known at once, but
/// modes and EDID are those of the last probe, which only the master has made: who opens it, where
/// no other program is.
class FakeKmsDevice final : public KmsDevice {
 public:
  FakeKmsDevice(FakeCard& card, VirtualClock& clock);
  ~FakeKmsDevice() override;
  FakeKmsDevice(const FakeKmsDevice&) = delete;
  FakeKmsDevice& operator=(const FakeKmsDevice&) = delete;

  /// The codes that leave a connector now; empty where it is dark.
  [[nodiscard]] Image<Rgb16> screen(std::size_t connector = 0);
  [[nodiscard]] std::uint64_t value(KmsId object, const std::string& name) const;
  void set_value(KmsId object, const std::string& name, std::uint64_t value);
  [[nodiscard]] std::size_t blobs_of_callers() const { return caller_blobs_; }
  [[nodiscard]] static KmsId connector_id(std::size_t i) { return static_cast<KmsId>(100 + i); }
  [[nodiscard]] static KmsId crtc_id(std::size_t i) { return static_cast<KmsId>(200 + i); }
  [[nodiscard]] static KmsId primary_id(std::size_t i) { return static_cast<KmsId>(300 + 2 * i); }
  [[nodiscard]] static KmsId cursor_id(std::size_t i) { return static_cast<KmsId>(301 + 2 * i); }

  [[nodiscard]] std::string path() const override { return card_.path; }
  [[nodiscard]] std::string driver() const override { return "fake"; }
  [[nodiscard]] Result<KmsResources> resources() override;
  [[nodiscard]] Result<KmsConnector> connector(KmsId id, bool probe) override;
  [[nodiscard]] Result<std::vector<KmsProperty>> properties(KmsId object, KmsKind kind) override;
  [[nodiscard]] Result<std::string> blob(KmsId id) override;
  [[nodiscard]] Result<KmsId> create_blob(std::string_view bytes) override;
  void destroy_blob(KmsId id) override;
  [[nodiscard]] int commit(std::span<const KmsSetting> settings,
                           KmsCommit how,
                           std::uint64_t token) override;
  [[nodiscard]] std::optional<KmsFlip> wait_flip(Time until) override;
  [[nodiscard]] std::vector<std::uint16_t> gamma_ramp(KmsId crtc) override;
  [[nodiscard]] int set_gamma_ramp(KmsId crtc, std::span<const std::uint16_t> ramp) override;
  [[nodiscard]] Result<KmsBuffer> create_buffer(int width,
                                                int height,
                                                std::uint32_t format,
                                                KmsMemory memory) override;
  void destroy_buffer(const KmsBuffer& buffer) override;
  [[nodiscard]] void* gbm_device() override { return card_.gpu ? this : nullptr; }
  [[nodiscard]] int become_master() override;
  void drop_master() override { master_ = false; }
  [[nodiscard]] bool changed() override;

 private:
  using Values = std::map<std::pair<KmsId, std::string>, std::uint64_t>;
  struct Memory {
    KmsBuffer buffer;
    std::byte* bytes = nullptr;
    std::size_t size = 0;
  };
  struct Waiting {
    std::uint64_t token = 0;
    Time time;
    Values values;
  };

  /// What the kernel knows of a display from the last time that it was asked.
  struct Known {
    std::vector<KmsMode> modes;
    std::string edid;
  };

  void called();
  void advance();
  [[nodiscard]] int check(const Values& values) const;
  void apply(const Values& values);
  void keep_colours(const Values& values);
  [[nodiscard]] std::string contents(KmsId framebuffer) const;
  [[nodiscard]] const Memory* memory(KmsId framebuffer) const;
  [[nodiscard]] static KmsId property_id(const std::string& name);

  FakeCard& card_;
  VirtualClock& clock_;
  bool master_;
  std::map<KmsId, Known> known_;
  Values values_;
  std::map<KmsId, std::string> blobs_;
  std::size_t caller_blobs_ = 0;
  KmsId next_id_ = 1000;
  std::vector<Memory> memories_;
  std::optional<Waiting> waiting_;
  std::deque<KmsFlip> flips_;
  // Of framebuffers that were committed, as they were then.
  std::map<KmsId, std::string> promised_;
};

}  // namespace veneer::projector
