// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "tracking/transports/internal_usb_transport.h"

namespace veneer::tracking {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

/// For cancelled transfers to come back. The kernel gives them back at once unless the host
/// controller hangs.
constexpr Duration kCancelPatience = milliseconds(200);
/// An upper bound on one round of waiting, which fits into a timeval.
constexpr Duration kLongestRound = std::chrono::seconds(10);
constexpr int kInterface = 0;
constexpr unsigned int kNoTimeout = 0;  // deadlines are kept here, not by libusb

/// libusb would list all devices and start a thread that listens for more; the port does both
/// better, without opening anything.
void switch_off_discovery() {
  static const int done = libusb_set_option(nullptr, LIBUSB_OPTION_NO_DEVICE_DISCOVERY);
  static_cast<void>(done);
}

int errno_of(int libusb_code) {
  switch (libusb_code) {
    case LIBUSB_ERROR_BUSY:
      return EBUSY;
    case LIBUSB_ERROR_ACCESS:
      return EACCES;
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:
      return ENODEV;
    case LIBUSB_ERROR_NO_MEM:
      return ENOMEM;
    default:
      return EIO;
  }
}

IoStatus status_of(libusb_transfer_status status) {
  switch (status) {
    case LIBUSB_TRANSFER_COMPLETED:
      return IoStatus::kOk;
    case LIBUSB_TRANSFER_STALL:
      return IoStatus::kStall;
    case LIBUSB_TRANSFER_OVERFLOW:
      return IoStatus::kOverflow;
    case LIBUSB_TRANSFER_NO_DEVICE:
      return IoStatus::kGone;
    case LIBUSB_TRANSFER_CANCELLED:
      return IoStatus::kTimeout;
    case LIBUSB_TRANSFER_TIMED_OUT:
    case LIBUSB_TRANSFER_ERROR:
      break;
  }
  return IoStatus::kIo;
}

}  // namespace

Result<std::unique_ptr<UsbTransport>> UsbTransport::open(const std::string& name,
                                                         const BusDevice& device,
                                                         const UsbModel& model,
                                                         Clock& clock) {
  std::unique_ptr<UsbTransport> transport(new UsbTransport(clock));
  int error = transport->claim(device);
  if (error == 0) error = transport->prepare_transfers(model);
  if (error != 0) return tl::unexpected<Error>(open_error(name, device, error));
  return transport;
}

int UsbTransport::claim(const BusDevice& device) {
  switch_off_discovery();
  if (libusb_init(&context_) != 0) return ENOMEM;
  node_ = UniqueFd(::open(device.node.c_str(), O_RDWR | O_CLOEXEC));
  if (!node_) return errno;
  int code = libusb_wrap_sys_device(context_, node_.value(), &handle_);
  if (code != 0) return errno_of(code);
  static_cast<void>(libusb_set_auto_detach_kernel_driver(handle_, 1));
  code = libusb_claim_interface(handle_, kInterface);
  claimed_ = code == 0;
  return claimed_ ? 0 : errno_of(code);
}

int UsbTransport::prepare_transfers(const UsbModel& model) {
  const UsbModel pipes = model.out != 0 ? model : described_endpoints();
  for (const UsbPipe& pipe : pipes.in)
    if (pipe.kind != UsbPipe::Kind::kNone) add_transfer(pipe);
  if (pipes.out == 0 || in_.empty()) return EPROTO;  // not what the table says it is
  out_.owner = this;
  out_.usb = libusb_alloc_transfer(0);
  if (out_.usb == nullptr) return ENOMEM;
  libusb_fill_bulk_transfer(
      out_.usb, handle_, pipes.out, nullptr, 0, &UsbTransport::on_transfer, &out_, kNoTimeout);
  for (const auto& transfer : in_)
    if (transfer->usb == nullptr) return ENOMEM;
  switch (submit_idle()) {
    case IoStatus::kOk:
      return 0;
    case IoStatus::kGone:
      return ENODEV;
    default:
      return EIO;
  }
}

UsbModel UsbTransport::described_endpoints() const {
  UsbModel model;
  libusb_config_descriptor* configuration = nullptr;
  if (libusb_get_config_descriptor(libusb_get_device(handle_), 0, &configuration) != 0)
    return model;
  std::size_t count = 0;
  if (configuration->bNumInterfaces > 0 && configuration->interface[0].num_altsetting > 0) {
    const libusb_interface_descriptor& interface = configuration->interface[0].altsetting[0];
    for (const libusb_endpoint_descriptor& endpoint :
         std::span(interface.endpoint, interface.bNumEndpoints)) {
      const unsigned int type = endpoint.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK;
      const bool bulk = type == LIBUSB_TRANSFER_TYPE_BULK;
      const bool in = (endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN) != 0;
      if (!in && bulk && model.out == 0) model.out = endpoint.bEndpointAddress;
      if (in && (bulk || type == LIBUSB_TRANSFER_TYPE_INTERRUPT) && count < model.in.size()) {
        model.in[count++] = {endpoint.bEndpointAddress,
                             bulk ? UsbPipe::Kind::kBulk : UsbPipe::Kind::kInterrupt};
      }
    }
  }
  libusb_free_config_descriptor(configuration);
  return model;
}

void UsbTransport::add_transfer(const UsbPipe& pipe) {
  for (std::size_t i = 0; i < kInFlight; ++i) {
    Transfer& transfer = *in_.emplace_back(std::make_unique<Transfer>());
    transfer.owner = this;
    transfer.buffer.resize(kTransferBytes);
    transfer.usb = libusb_alloc_transfer(0);
    if (transfer.usb == nullptr) return;
    const auto fill = pipe.kind == UsbPipe::Kind::kBulk ? &libusb_fill_bulk_transfer
                                                        : &libusb_fill_interrupt_transfer;
    fill(transfer.usb,
         handle_,
         pipe.endpoint,
         transfer.buffer.data(),
         static_cast<int>(kTransferBytes),
         &UsbTransport::on_transfer,
         &transfer,
         kNoTimeout);
  }
}

UsbTransport::~UsbTransport() {
  closing_ = true;
  cancel_all();
  collect();
  if (claimed_ && !gone_) static_cast<void>(libusb_release_interface(handle_, kInterface));
  // Should a transfer still be out, closing takes it from libusb, and the descriptor that is closed
  // below takes it from the kernel, before its buffer goes.
  if (handle_ != nullptr) libusb_close(handle_);
  for (const auto& transfer : in_) libusb_free_transfer(transfer->usb);
  libusb_free_transfer(out_.usb);
  if (context_ != nullptr) libusb_exit(context_);
  node_.reset();
}

void LIBUSB_CALL UsbTransport::on_transfer(libusb_transfer* usb) {
  auto& transfer = *static_cast<Transfer*>(usb->user_data);
  transfer.in_flight = false;
  if (usb->status == LIBUSB_TRANSFER_NO_DEVICE) transfer.owner->gone_ = true;
  if ((usb->endpoint & LIBUSB_ENDPOINT_IN) != 0) transfer.owner->on_received(transfer);
}

void UsbTransport::on_received(Transfer& transfer) {
  if (closing_) return;
  const IoStatus status = status_of(transfer.usb->status);
  if (status != IoStatus::kOk && status != IoStatus::kTimeout) {
    push(status);  // and not submitted again before that has been read: errors come one at a time
    return;
  }
  const auto size = static_cast<std::size_t>(transfer.usb->actual_length);
  if (size > 0) {  // an empty packet says nothing; a cancelled transfer may still bring something
    push(IoStatus::kOk);
    messages_.back().size = size;
    std::copy_n(transfer.buffer.begin(), size, messages_.back().bytes.begin());
  }
  if (status == IoStatus::kOk && !gone_ && messages_.size() < kBacklog) {
    const IoStatus again = submit(transfer);
    if (again != IoStatus::kOk) push(again);
  }
}

void UsbTransport::push(IoStatus status) {
  if (status == IoStatus::kGone) {
    gone_ = true;
    return;
  }
  Message& message = messages_.emplace_back();
  message.status = status;
  message.arrival = clock_.now();
}

IoStatus UsbTransport::submit(Transfer& transfer) {
  const int code = libusb_submit_transfer(transfer.usb);
  transfer.in_flight = code == 0;
  if (code == 0) return IoStatus::kOk;
  return code == LIBUSB_ERROR_NO_DEVICE ? IoStatus::kGone : IoStatus::kIo;
}

IoStatus UsbTransport::submit_idle() {
  IoStatus worst = IoStatus::kOk;
  for (const auto& transfer : in_) {
    if (transfer->in_flight) continue;
    const IoStatus status = submit(*transfer);
    if (status == IoStatus::kOk) continue;
    worst = status;
    if (status == IoStatus::kGone) break;
  }
  return worst;
}

Received UsbTransport::read(std::span<std::byte> buffer, Time deadline) {
  VENEER_CHECK(buffer.size() >= kTransferBytes);
  if (!gone_ && messages_.size() < kBacklog) {
    const IoStatus status = submit_idle();
    if (status != IoStatus::kOk) push(status);
  }
  // What had come before it went is still to be had. Once even without patience: what came before
  // the call is to be there.
  const auto waits = [this] { return messages_.empty() && (!gone_ || any_in_flight()); };
  do {
    if (waits()) handle_events(deadline);
  } while (waits() && clock_.now() < deadline);
  if (messages_.empty()) return {gone_ ? IoStatus::kGone : IoStatus::kTimeout, 0, clock_.now()};
  const Message message = messages_.front();
  messages_.pop_front();
  std::memcpy(buffer.data(), message.bytes.data(), message.size);
  return {message.status, message.size, message.arrival};
}

IoStatus UsbTransport::write(std::span<const std::byte> bytes, Time deadline) {
  if (gone_) return IoStatus::kGone;
  if (out_.in_flight) return IoStatus::kIo;  // the one before could not even be cancelled
  out_.buffer.resize(bytes.size());
  std::memcpy(out_.buffer.data(), bytes.data(), bytes.size());
  out_.usb->buffer = out_.buffer.data();
  out_.usb->length = static_cast<int>(bytes.size());
  const IoStatus submitted = submit(out_);
  if (submitted == IoStatus::kGone) gone_ = true;
  if (submitted != IoStatus::kOk) return submitted;
  while (out_.in_flight && clock_.now() < deadline) handle_events(deadline);
  if (out_.in_flight) {
    static_cast<void>(libusb_cancel_transfer(out_.usb));
    const Time give_up = clock_.now() + kCancelPatience;
    while (out_.in_flight && clock_.now() < give_up) handle_events(give_up);
    if (out_.in_flight) return IoStatus::kTimeout;
  }
  const IoStatus status = status_of(out_.usb->status);
  const bool whole = out_.usb->actual_length == out_.usb->length;
  return status == IoStatus::kOk && !whole ? IoStatus::kIo : status;
}

IoStatus UsbTransport::clear_stall() {
  if (gone_) return IoStatus::kGone;
  cancel_all();
  collect();
  if (any_in_flight()) return IoStatus::kIo;
  int code = libusb_clear_halt(handle_, out_.usb->endpoint);
  for (std::size_t i = 0; i < in_.size() && code == 0; i += kInFlight)
    code = libusb_clear_halt(handle_, in_[i]->usb->endpoint);
  gone_ = gone_ || code == LIBUSB_ERROR_NO_DEVICE;
  return code == 0 ? IoStatus::kOk : gone_ ? IoStatus::kGone : IoStatus::kIo;
}

void UsbTransport::handle_events(Time until) {
  const Duration left = std::clamp(until - clock_.now(), Duration{}, kLongestRound);
  const auto us = std::chrono::ceil<microseconds>(left).count();
  timeval timeout{us / 1'000'000, us % 1'000'000};
  const int code = libusb_handle_events_timeout_completed(context_, &timeout, nullptr);
  if (code != 0 && code != LIBUSB_ERROR_INTERRUPTED)
    push(code == LIBUSB_ERROR_NO_DEVICE ? IoStatus::kGone : IoStatus::kIo);
}

void UsbTransport::cancel_all() {
  for (const auto& transfer : in_)
    if (transfer->in_flight) static_cast<void>(libusb_cancel_transfer(transfer->usb));
  if (out_.in_flight) static_cast<void>(libusb_cancel_transfer(out_.usb));
}

void UsbTransport::collect() {
  const Time give_up = clock_.now() + kCancelPatience;
  while (any_in_flight() && clock_.now() < give_up) handle_events(give_up);
}

bool UsbTransport::any_in_flight() const {
  return out_.in_flight ||
         std::ranges::any_of(in_, [](const auto& transfer) { return transfer->in_flight; });
}

}  // namespace veneer::tracking
