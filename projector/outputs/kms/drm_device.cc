// SPDX-License-Identifier: Apache-2.0
// KmsDevice on libdrm, GBM and libudev.
#include <drm_fourcc.h>
#include <fcntl.h>
#include <gbm.h>
#include <libudev.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <xf86drm.h>
#include <xf86drmMode.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "base/unique_handle.h"
#include "projector/outputs/kms/kms_device.h"

namespace veneer::projector {
namespace {

/// Of a pointer that one function of C gives and another one frees.
template <auto kFree>
struct Freed {
  template <class T>
  void operator()(T* pointer) const noexcept {
    kFree(pointer);
  }
};
template <class T, auto kFree>
using Handle = std::unique_ptr<T, Freed<kFree>>;

using ResourcesHandle = Handle<drmModeRes, drmModeFreeResources>;
using PlanesHandle = Handle<drmModePlaneRes, drmModeFreePlaneResources>;
using PlaneHandle = Handle<drmModePlane, drmModeFreePlane>;
using ConnectorHandle = Handle<drmModeConnector, drmModeFreeConnector>;
using CrtcHandle = Handle<drmModeCrtc, drmModeFreeCrtc>;
using PropertiesHandle = Handle<drmModeObjectProperties, drmModeFreeObjectProperties>;
using PropertyHandle = Handle<drmModePropertyRes, drmModeFreeProperty>;
using BlobHandle = Handle<drmModePropertyBlobRes, drmModeFreePropertyBlob>;
using VersionHandle = Handle<drmVersion, drmFreeVersion>;
using GbmDevice = Handle<::gbm_device, gbm_device_destroy>;
using GbmBuffer = Handle<gbm_bo, gbm_bo_destroy>;
using Udev = Handle<udev, udev_unref>;
using UdevMonitor = Handle<udev_monitor, udev_monitor_unref>;
using UdevDevice = Handle<udev_device, udev_device_unref>;

KmsMode mode_of(const drmModeModeInfo& info) {
  KmsMode mode;
  mode.bytes.assign(reinterpret_cast<const char*>(&info), sizeof(info));
  mode.width = info.hdisplay;
  mode.height = info.vdisplay;
  mode.preferred = (info.type & DRM_MODE_TYPE_PREFERRED) != 0;
  mode.interlaced = (info.flags & DRM_MODE_FLAG_INTERLACE) != 0;
  const double pixels = double{1.0} * info.htotal * info.vtotal;
  if (pixels > 0) mode.refresh_hz = info.clock * 1000.0 / pixels;
  if (mode.interlaced) mode.refresh_hz *= 2;
  if ((info.flags & DRM_MODE_FLAG_DBLSCAN) != 0) mode.refresh_hz /= 2;
  if (info.vscan > 1) mode.refresh_hz /= info.vscan;
  return mode;
}

std::vector<KmsId> crtcs_of(const drmModeRes& resources, std::uint32_t mask) {
  std::vector<KmsId> crtcs;
  for (int i = 0; i < resources.count_crtcs && i < 32; ++i) {
    if ((mask >> static_cast<unsigned>(i) & 1U) != 0) crtcs.push_back(resources.crtcs[i]);
  }
  return crtcs;
}

std::uint32_t object_type(KmsKind kind) {
  switch (kind) {
    case KmsKind::kConnector:
      return DRM_MODE_OBJECT_CONNECTOR;
    case KmsKind::kCrtc:
      return DRM_MODE_OBJECT_CRTC;
    case KmsKind::kPlane:
      return DRM_MODE_OBJECT_PLANE;
  }
  return DRM_MODE_OBJECT_ANY;
}

class DrmDevice final : public KmsDevice {
 public:
  DrmDevice(std::string path, std::string driver, UniqueFd fd)
      : path_(std::move(path)), driver_(std::move(driver)), fd_(std::move(fd)) {
    // Without udev, changes are still found, when a frame is refused or by asking now and then.
    udev_.reset(udev_new());
    if (!udev_) return;
    monitor_.reset(udev_monitor_new_from_netlink(udev_.get(), "udev"));
    if (!monitor_) return;
    if (udev_monitor_filter_add_match_subsystem_devtype(monitor_.get(), "drm", nullptr) < 0 ||
        udev_monitor_enable_receiving(monitor_.get()) < 0)
      monitor_.reset();
  }
  ~DrmDevice() override {
    for (const Memory& memory : memories_) release(memory);
  }
  DrmDevice(const DrmDevice&) = delete;
  DrmDevice& operator=(const DrmDevice&) = delete;

  [[nodiscard]] std::string path() const override { return path_; }
  [[nodiscard]] std::string driver() const override { return driver_; }

  [[nodiscard]] Result<KmsResources> resources() override {
    const ResourcesHandle resources(drmModeGetResources(fd_.value()));
    const PlanesHandle planes(drmModeGetPlaneResources(fd_.value()));
    if (!resources || !planes) return failed("asking what it has");
    KmsResources found;
    found.connectors.assign(resources->connectors,
                            resources->connectors + resources->count_connectors);
    found.crtcs.assign(resources->crtcs, resources->crtcs + resources->count_crtcs);
    for (std::uint32_t i = 0; i < planes->count_planes; ++i) {
      const PlaneHandle plane(drmModeGetPlane(fd_.value(), planes->planes[i]));
      if (!plane) continue;
      found.planes.push_back({plane->plane_id,
                              crtcs_of(*resources, plane->possible_crtcs),
                              {plane->formats, plane->formats + plane->count_formats}});
    }
    return found;
  }

  [[nodiscard]] Result<KmsConnector> connector(KmsId id, bool probe) override {
    const ConnectorHandle connector(probe ? drmModeGetConnector(fd_.value(), id)
                                          : drmModeGetConnectorCurrent(fd_.value(), id));
    const ResourcesHandle resources(drmModeGetResources(fd_.value()));
    if (!connector || !resources) return failed(fmt::format("asking for connector {}", id));
    KmsConnector found;
    found.id = id;
    const char* type = drmModeGetConnectorTypeName(connector->connector_type);
    found.name =
        fmt::format("{}-{}", type == nullptr ? "Unknown" : type, connector->connector_type_id);
    found.connected = connector->connection == DRM_MODE_CONNECTED;
    for (int i = 0; i < connector->count_modes; ++i)
      found.modes.push_back(mode_of(connector->modes[i]));
    found.possible_crtcs =
        crtcs_of(*resources, drmModeConnectorGetPossibleCrtcs(fd_.value(), connector.get()));
    VENEER_ASSIGN(const std::vector<KmsProperty> known, properties(id, KmsKind::kConnector));
    const KmsProperty* edid = find_property(known, "EDID");
    if (edid != nullptr && edid->value != 0)
      found.edid = blob(static_cast<KmsId>(edid->value)).value_or("");
    return found;
  }

  [[nodiscard]] Result<std::vector<KmsProperty>> properties(KmsId object, KmsKind kind) override {
    const PropertiesHandle listed(
        drmModeObjectGetProperties(fd_.value(), object, object_type(kind)));
    if (!listed) return failed(fmt::format("asking for the properties of object {}", object));
    std::vector<KmsProperty> found;
    for (std::uint32_t i = 0; i < listed->count_props; ++i) {
      const PropertyHandle property(drmModeGetProperty(fd_.value(), listed->props[i]));
      if (!property) continue;
      KmsProperty each;
      each.id = property->prop_id;
      each.name.assign(property->name, ::strnlen(property->name, DRM_PROP_NAME_LEN));
      each.value = listed->prop_values[i];
      each.is_blob = drm_property_type_is(property.get(), DRM_MODE_PROP_BLOB) != 0;
      if (drm_property_type_is(property.get(), DRM_MODE_PROP_RANGE) != 0 &&
          property->count_values == 2)
        each.range.emplace(property->values[0], property->values[1]);
      for (int k = 0; k < property->count_enums; ++k) {
        const drm_mode_property_enum& choice = property->enums[k];
        each.choices.emplace_back(
            std::string(choice.name, ::strnlen(choice.name, DRM_PROP_NAME_LEN)), choice.value);
      }
      found.push_back(std::move(each));
    }
    return found;
  }

  [[nodiscard]] Result<std::string> blob(KmsId id) override {
    const BlobHandle blob(drmModeGetPropertyBlob(fd_.value(), id));
    if (!blob) return failed(fmt::format("reading blob {}", id));
    return std::string(static_cast<const char*>(blob->data), blob->length);
  }
  [[nodiscard]] Result<KmsId> create_blob(std::string_view bytes) override {
    KmsId id = 0;
    if (drmModeCreatePropertyBlob(fd_.value(), bytes.data(), bytes.size(), &id) != 0)
      return failed("making a blob");
    return id;
  }
  void destroy_blob(KmsId id) override { drmModeDestroyPropertyBlob(fd_.value(), id); }

  [[nodiscard]] int commit(std::span<const KmsSetting> settings,
                           KmsCommit how,
                           std::uint64_t token) override {
    // libdrm's own requests allocate, which the frame loop does not.
    if (settings.size() > kMostSettings) return E2BIG;
    std::array<std::uint32_t, kMostSettings> objects{};
    std::array<std::uint32_t, kMostSettings> counts{};
    std::array<std::uint32_t, kMostSettings> ids{};
    std::array<std::uint64_t, kMostSettings> values{};
    std::size_t object_count = 0;
    for (std::size_t i = 0; i < settings.size(); ++i) {
      if (object_count == 0 || objects[object_count - 1] != settings[i].object)
        objects[object_count++] = settings[i].object;
      ++counts[object_count - 1];
      ids[i] = settings[i].property;
      values[i] = settings[i].value;
    }
    drm_mode_atomic request{};
    switch (how) {
      case KmsCommit::kTest:
        request.flags = DRM_MODE_ATOMIC_TEST_ONLY | DRM_MODE_ATOMIC_ALLOW_MODESET;
        break;
      case KmsCommit::kFull:
        request.flags = DRM_MODE_ATOMIC_ALLOW_MODESET;
        break;
      case KmsCommit::kFlip:
        request.flags = DRM_MODE_ATOMIC_NONBLOCK | DRM_MODE_PAGE_FLIP_EVENT;
        request.user_data = token;
        break;
    }
    const auto address = [](auto& array) { return reinterpret_cast<std::uintptr_t>(array.data()); };
    request.count_objs = static_cast<std::uint32_t>(object_count);
    request.objs_ptr = address(objects);
    request.count_props_ptr = address(counts);
    request.props_ptr = address(ids);
    request.prop_values_ptr = address(values);
    return drmIoctl(fd_.value(), DRM_IOCTL_MODE_ATOMIC, &request) == 0 ? 0 : errno;
  }

  [[nodiscard]] std::optional<KmsFlip> wait_flip(Time until) override {
    while (flip_count_ == 0) {
      const Duration left = std::max(until - Time::clock::now(), Duration::zero());
      const timespec timeout{static_cast<time_t>(left.count() / 1'000'000'000),
                             static_cast<long>(left.count() % 1'000'000'000)};
      pollfd poll{fd_.value(), POLLIN, 0};
      const int ready = ::ppoll(&poll, 1, &timeout, nullptr);
      if (ready < 0 && errno == EINTR) continue;
      if (ready <= 0 || (poll.revents & POLLIN) == 0) return std::nullopt;
      read_flips();
    }
    const KmsFlip first = flips_[0];
    std::move(flips_.begin() + 1,
              flips_.begin() + static_cast<std::ptrdiff_t>(flip_count_),
              flips_.begin());
    --flip_count_;
    return first;
  }

  [[nodiscard]] std::vector<std::uint16_t> gamma_ramp(KmsId crtc) override {
    const CrtcHandle state(drmModeGetCrtc(fd_.value(), crtc));
    if (!state || state->gamma_size <= 0) return {};
    const auto size = static_cast<std::size_t>(state->gamma_size);
    std::vector<std::uint16_t> ramp(3 * size);
    if (drmModeCrtcGetGamma(fd_.value(),
                            crtc,
                            static_cast<std::uint32_t>(size),
                            ramp.data(),
                            ramp.data() + size,
                            ramp.data() + 2 * size) != 0)
      return {};
    return ramp;
  }
  [[nodiscard]] int set_gamma_ramp(KmsId crtc, std::span<const std::uint16_t> ramp) override {
    const std::size_t size = ramp.size() / 3;
    // libdrm takes pointers to what it does not change.
    auto* values = const_cast<std::uint16_t*>(ramp.data());
    return drmModeCrtcSetGamma(fd_.value(),
                               crtc,
                               static_cast<std::uint32_t>(size),
                               values,
                               values + size,
                               values + 2 * size) == 0
               ? 0
               : errno;
  }

  [[nodiscard]] Result<KmsBuffer> create_buffer(int width,
                                                int height,
                                                std::uint32_t format,
                                                KmsMemory memory) override {
    Memory made;
    made.buffer.width = width;
    made.buffer.height = height;
    made.buffer.format = format;
    Status filled = memory == KmsMemory::kMapped ? map(made) : take_from_gpu(made);
    if (filled) filled = add_framebuffer(made);
    if (!filled) {
      release(made);
      return tl::unexpected<Error>(std::move(filled).error());
    }
    const KmsBuffer buffer = made.buffer;
    memories_.push_back(std::move(made));
    return buffer;
  }
  void destroy_buffer(const KmsBuffer& buffer) override {
    std::erase_if(memories_, [this, &buffer](const Memory& memory) {
      if (memory.buffer.framebuffer != buffer.framebuffer) return false;
      release(memory);
      return true;
    });
  }
  [[nodiscard]] void* gbm_device() override { return gbm_.get(); }

  [[nodiscard]] int become_master() override {
    return drmIsMaster(fd_.value()) != 0 || drmSetMaster(fd_.value()) == 0 ? 0 : errno;
  }
  void drop_master() override { drmDropMaster(fd_.value()); }

  [[nodiscard]] bool changed() override {
    bool any = false;
    while (monitor_) {
      const UdevDevice event(udev_monitor_receive_device(monitor_.get()));
      if (!event) break;
      any = any || is_ours(event.get());
    }
    return any;
  }

 private:
  /// Some 20 for a display and 3 for each plane or display that is switched off.
  static constexpr std::size_t kMostSettings = 128;
  static constexpr int kBytesPerPixel = 4;

  struct Memory {
    KmsBuffer buffer;
    std::uint32_t handle = 0;  // of a mapped one, or borrowed from `gpu`
    std::size_t bytes = 0;
    GbmBuffer gpu;
    UniqueFd descriptor;
  };

  [[nodiscard]] tl::unexpected<Error> failed(std::string_view doing) const {
    const int error = errno;
    const Errc code = error == ENODEV ? Errc::kDisconnected : Errc::kUnavailable;
    return fail(code, "{}: {}: {}", path_, doing, std::strerror(error));
  }

  /// What changes at another card is not asked about: that would hold frames up.
  [[nodiscard]] bool is_ours(udev_device* event) const {
    struct stat node {};
    if (::fstat(fd_.value(), &node) != 0) return true;
    // An event is the card's, or of a socket of it.
    for (udev_device* each = event; each != nullptr; each = udev_device_get_parent(each)) {
      if (udev_device_get_devnum(each) == node.st_rdev) return true;
    }
    return false;
  }

  void read_flips() {
    alignas(drm_event_vblank) std::array<char, 1024> bytes{};
    const ssize_t count = ::read(fd_.value(), bytes.data(), bytes.size());
    for (std::size_t at = 0; count > 0 && at + sizeof(drm_event) <= std::size_t(count);) {
      drm_event head{};
      std::memcpy(&head, bytes.data() + at, sizeof(head));
      if (head.length < sizeof(head) || at + head.length > std::size_t(count)) return;
      if (head.type == DRM_EVENT_FLIP_COMPLETE && head.length >= sizeof(drm_event_vblank) &&
          flip_count_ < flips_.size()) {
        drm_event_vblank event{};
        std::memcpy(&event, bytes.data() + at, sizeof(event));
        flips_[flip_count_++] = {
            event.user_data,
            event.sequence,
            Time(std::chrono::seconds(event.tv_sec) + std::chrono::microseconds(event.tv_usec))};
      }
      at += head.length;
    }
  }

  [[nodiscard]] Status map(Memory& memory) {
    drm_mode_create_dumb create{};
    create.width = static_cast<std::uint32_t>(memory.buffer.width);
    create.height = static_cast<std::uint32_t>(memory.buffer.height);
    create.bpp = 8 * kBytesPerPixel;
    if (drmIoctl(fd_.value(), DRM_IOCTL_MODE_CREATE_DUMB, &create) != 0)
      return failed("taking memory for pixels");
    memory.handle = create.handle;
    memory.buffer.stride = create.pitch;
    drm_mode_map_dumb where{};
    where.handle = create.handle;
    if (drmIoctl(fd_.value(), DRM_IOCTL_MODE_MAP_DUMB, &where) != 0)
      return failed("mapping memory for pixels");
    void* pixels = ::mmap(nullptr,
                          create.size,
                          PROT_READ | PROT_WRITE,
                          MAP_SHARED,
                          fd_.value(),
                          static_cast<off_t>(where.offset));
    if (pixels == MAP_FAILED) return failed("mapping memory for pixels");
    memory.bytes = create.size;
    memory.buffer.pixels = static_cast<std::byte*>(pixels);
    std::memset(pixels, 0, create.size);
    return {};
  }

  [[nodiscard]] Status take_from_gpu(Memory& memory) {
    if (!gbm_) gbm_.reset(gbm_create_device(fd_.value()));
    if (!gbm_) return failed("reaching the GPU");
    KmsBuffer& buffer = memory.buffer;
    memory.gpu.reset(gbm_bo_create(gbm_.get(),
                                   static_cast<std::uint32_t>(buffer.width),
                                   static_cast<std::uint32_t>(buffer.height),
                                   buffer.format,
                                   GBM_BO_USE_SCANOUT | GBM_BO_USE_RENDERING));
    if (!memory.gpu) return failed("taking the GPU's memory for pixels");
    if (gbm_bo_get_plane_count(memory.gpu.get()) != 1)
      return fail(Errc::kUnavailable,
                  "{}: the GPU's buffers have several planes, of which nothing is known here",
                  path_);
    memory.handle = gbm_bo_get_handle(memory.gpu.get()).u32;
    memory.descriptor = UniqueFd(gbm_bo_get_fd(memory.gpu.get()));
    if (!memory.descriptor) return failed("sharing the GPU's memory");
    buffer.descriptor = memory.descriptor.value();
    buffer.stride = gbm_bo_get_stride(memory.gpu.get());
    buffer.offset = gbm_bo_get_offset(memory.gpu.get(), 0);
    buffer.modifier = gbm_bo_get_modifier(memory.gpu.get());
    return {};
  }

  [[nodiscard]] Status add_framebuffer(Memory& memory) {
    KmsBuffer& buffer = memory.buffer;
    const auto width = static_cast<std::uint32_t>(buffer.width);
    const auto height = static_cast<std::uint32_t>(buffer.height);
    const std::uint32_t handles[4] = {memory.handle};
    const std::uint32_t strides[4] = {buffer.stride};
    const std::uint32_t offsets[4] = {buffer.offset};
    const std::uint64_t modifiers[4] = {buffer.modifier};
    std::uint64_t takes_modifiers = 0;
    drmGetCap(fd_.value(), DRM_CAP_ADDFB2_MODIFIERS, &takes_modifiers);
    const bool tell =
        memory.gpu && takes_modifiers != 0 && buffer.modifier != DRM_FORMAT_MOD_INVALID;
    const int refused = tell ? drmModeAddFB2WithModifiers(fd_.value(),
                                                          width,
                                                          height,
                                                          buffer.format,
                                                          handles,
                                                          strides,
                                                          offsets,
                                                          modifiers,
                                                          &buffer.framebuffer,
                                                          DRM_MODE_FB_MODIFIERS)
                             : drmModeAddFB2(fd_.value(),
                                             width,
                                             height,
                                             buffer.format,
                                             handles,
                                             strides,
                                             offsets,
                                             &buffer.framebuffer,
                                             0);
    if (refused != 0) return failed("making a framebuffer");
    return {};
  }

  void release(const Memory& memory) {
    if (memory.buffer.framebuffer != 0) drmModeRmFB(fd_.value(), memory.buffer.framebuffer);
    if (memory.buffer.pixels != nullptr) ::munmap(memory.buffer.pixels, memory.bytes);
    if (!memory.gpu && memory.handle != 0) {
      drm_mode_destroy_dumb destroy{};
      destroy.handle = memory.handle;
      drmIoctl(fd_.value(), DRM_IOCTL_MODE_DESTROY_DUMB, &destroy);
    }
  }

  std::string path_;
  std::string driver_;
  UniqueFd fd_;
  Udev udev_;
  UdevMonitor monitor_;
  GbmDevice gbm_;
  std::vector<Memory> memories_;  // before gbm_ in death
  std::array<KmsFlip, 32> flips_{};
  std::size_t flip_count_ = 0;
};

}  // namespace

Result<std::unique_ptr<KmsDevice>> open_kms_device(const std::filesystem::path& path) {
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK));
  if (!fd) {
    const int error = errno;
    if (error == ENOENT)
      return fail(Errc::kNotFound,
                  "{}: there is no such card; is the graphics driver loaded (ls /dev/dri)?",
                  path.string());
    return fail(Errc::kIo,
                "{}: {}; may this user open it? Its group is `video` as a rule",
                path.string(),
                std::strerror(error));
  }
  const VersionHandle version(drmGetVersion(fd.value()));
  if (!version) return fail(Errc::kUnavailable, "{} is no graphics card", path.string());
  const std::string driver(version->name, static_cast<std::size_t>(version->name_len));
  const ResourcesHandle resources(drmModeGetResources(fd.value()));
  if (!resources || resources->count_connectors == 0 || resources->count_crtcs == 0)
    return fail(
        Errc::kUnavailable, "{} ({}) has nothing to plug a display into", path.string(), driver);
  if (drmSetClientCap(fd.value(), DRM_CLIENT_CAP_UNIVERSAL_PLANES, 1) != 0 ||
      drmSetClientCap(fd.value(), DRM_CLIENT_CAP_ATOMIC, 1) != 0)
    return fail(Errc::kUnavailable,
                "{}: its driver {} has no atomic mode setting; use another card, or a desktop and "
                "the output \"window\"",
                path.string(),
                driver);
  return std::make_unique<DrmDevice>(path.string(), driver, std::move(fd));
}

}  // namespace veneer::projector
