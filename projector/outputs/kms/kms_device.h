// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "base/result.h"

namespace veneer::projector {

/// Of an object, property, blob or framebuffer of one card; 0 is none.
using KmsId = std::uint32_t;

/// The pixel formats that are scanned out, as in drm_fourcc.h: in each 32-bit little-endian word
/// red, green and blue from high to low, under two or eight unused bits.
inline constexpr std::uint32_t kXrgb8888 = 0x34325258;
inline constexpr std::uint32_t kXrgb2101010 = 0x30335258;

struct KmsMode {
  std::string bytes;  ///< the kernel's own record of it: what a MODE_ID blob holds
  int width = 0;      ///< pixels
  int height = 0;
  double refresh_hz = 0;  ///< fields a second where it is interlaced
  bool preferred = false;
  bool interlaced = false;
};

struct KmsConnector {
  KmsId id = 0;
  std::string name;  ///< "HDMI-A-1"
  bool connected = false;
  std::vector<KmsMode> modes;
  std::vector<KmsId> possible_crtcs;
  std::string edid;  ///< bytes; empty where the display gives none
};

struct KmsPlane {
  KmsId id = 0;
  std::vector<KmsId> possible_crtcs;
  std::vector<std::uint32_t> formats;
};

struct KmsResources {
  std::vector<KmsId> connectors;
  std::vector<KmsId> crtcs;
  std::vector<KmsPlane> planes;
};

struct KmsProperty {
  KmsId id = 0;
  std::string name;
  std::uint64_t value = 0;
  bool is_blob = false;
  std::vector<std::pair<std::string, std::uint64_t>> choices;    ///< of an enumeration or bit mask
  std::optional<std::pair<std::uint64_t, std::uint64_t>> range;  ///< both ends are in it
};

enum class KmsKind { kConnector, kCrtc, kPlane };

struct KmsSetting {
  KmsId object = 0;
  KmsId property = 0;
  std::uint64_t value = 0;
};

enum class KmsCommit {
  kTest,  ///< would it do? Changes nothing
  kFull,  ///< may change modes, and returns when it is done
  kFlip,  ///< returns at once; a KmsFlip follows when it is on the screen
};

struct KmsFlip {
  std::uint64_t token = 0;     ///< as it was given to commit()
  std::uint32_t sequence = 0;  ///< vertical retraces, counted by the display; 0 where it has none
  Time time;                   ///< of the retrace, when the first line goes out
};

enum class KmsMemory {
  kMapped,  ///< written by the CPU
  kGpu,     ///< a dma-buf that a GPU draws into
};

struct KmsBuffer {
  KmsId framebuffer = 0;
  int width = 0;
  int height = 0;
  std::uint32_t format = 0;
  std::uint32_t stride = 0;  ///< bytes
  std::uint32_t offset = 0;  ///< bytes
  std::uint64_t modifier = 0;
  std::byte* pixels = nullptr;  ///< kMapped only
  int descriptor = -1;          ///< kGpu only; the device's
};

/// What the output asks of a display card: the calls of the kernel's mode setting, and no more, so
/// that tests can put another card in. Numbers that calls return are 0 or the errno with which
/// the kernel refused. Owns its buffers and blobs. One thread.
class KmsDevice {
 public:
  virtual ~KmsDevice() = default;
  [[nodiscard]] virtual std::string path() const = 0;
  [[nodiscard]] virtual std::string driver() const = 0;

  [[nodiscard]] virtual Result<KmsResources> resources() = 0;
  /// @param probe  asks the display itself, which may take a tenth of a second; else what the
  ///               kernel knows. Asking is the master's right: to others the kernel says what it
  ///               knows (Linux 5.15, drm_mode_getconnector).
  [[nodiscard]] virtual Result<KmsConnector> connector(KmsId id, bool probe) = 0;
  [[nodiscard]] virtual Result<std::vector<KmsProperty>> properties(KmsId object, KmsKind kind) = 0;
  [[nodiscard]] virtual Result<std::string> blob(KmsId id) = 0;
  [[nodiscard]] virtual Result<KmsId> create_blob(std::string_view bytes) = 0;
  virtual void destroy_blob(KmsId id) = 0;

  /// All of the settings or none; those of one object stand together. At most one kFlip is under
  /// way; a second one is refused with EBUSY. Does not allocate for kFlip.
  [[nodiscard]] virtual int commit(std::span<const KmsSetting> settings,
                                   KmsCommit how,
                                   std::uint64_t token = 0) = 0;
  /// The next flip that was seen; waits for one until a time, or not at all where that has passed.
  [[nodiscard]] virtual std::optional<KmsFlip> wait_flip(Time until) = 0;

  /// The ramp of cards without a GAMMA_LUT: reds, then greens, then blues; empty without one.
  [[nodiscard]] virtual std::vector<std::uint16_t> gamma_ramp(KmsId crtc) = 0;
  [[nodiscard]] virtual int set_gamma_ramp(KmsId crtc, std::span<const std::uint16_t> ramp) = 0;

  /// Black until somebody draws. Errors: kUnavailable (no such format or memory).
  [[nodiscard]] virtual Result<KmsBuffer> create_buffer(int width,
                                                        int height,
                                                        std::uint32_t format,
                                                        KmsMemory memory) = 0;
  virtual void destroy_buffer(const KmsBuffer& buffer) = 0;
  /// struct gbm_device*, once there is a buffer for the GPU; else null. The device's.
  [[nodiscard]] virtual void* gbm_device() = 0;

  /// Only one program at a time may change what a card shows.
  [[nodiscard]] virtual int become_master() = 0;
  virtual void drop_master() = 0;
  /// Whether something was plugged in or out since the last call. Never waits.
  [[nodiscard]] virtual bool changed() = 0;
};

/// Nodes in /dev/dri that may be display cards, in the order of their numbers.
[[nodiscard]] std::vector<std::filesystem::path> kms_device_paths();

/// A card through libdrm. Does not ask to be master, but the first program that opens one is.
/// Errors: kNotFound, kIo (may not open it), kUnavailable (shows nothing, or without atomic mode
/// setting).
[[nodiscard]] Result<std::unique_ptr<KmsDevice>> open_kms_device(const std::filesystem::path& path);

/// The property of that name, null where there is none.
[[nodiscard]] const KmsProperty* find_property(std::span<const KmsProperty> properties,
                                               std::string_view name);
/// The value of that choice of an enumeration.
[[nodiscard]] std::optional<std::uint64_t> find_choice(const KmsProperty& property,
                                                       std::string_view choice);

}  // namespace veneer::projector
