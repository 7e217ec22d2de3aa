// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/toml_reader.h"
#include "projector/output.h"
#include "projector/outputs/kms/card_choice.h"
#include "projector/outputs/kms/colour_state.h"
#include "projector/outputs/kms/display_choice.h"
#include "projector/outputs/kms/kms_device.h"

namespace veneer::projector {

struct KmsOutputOptions {
  enum class Buffers {
    kAuto,    ///< the GPU's, or else mapped ones
    kGpu,     ///< the renderer draws into what is scanned out
    kMapped,  ///< present() writes the pixels
  };
  std::filesystem::path device;  ///< empty: as choose_card()
  std::string connector;         ///< as choose_display()
  std::string mode;              ///< as choose_mode()
  int bits = 8;                  ///< of a channel: 8 or 10
  bool bits_fallback =
      false;  ///< 8 bits where 10 are refused, with a warning, in place of an error
  Buffers buffers = Buffers::kAuto;
  std::filesystem::path state_directory;  ///< for ColourKeeper
  [[nodiscard]] Status check() const;
};

/// A display of a card with no desktop in between: the codes are what leaves the connector. Tables
/// and matrices of the card are switched off while it is open and brought back by the destructor,
/// or by the next start. Frames go out at the vertical retrace, from three buffers.
class KmsOutput final : public Output {
 public:
  /// How long a frame may be on its way to the screen before the card counts as hung: dozens of
  /// refreshes, and well under the ten seconds after which the kernel gives up itself.
  static constexpr Duration kFlipTimeout = std::chrono::seconds(1);
  /// Between two attempts to get a display back.
  static constexpr Duration kRetryPeriod = std::chrono::milliseconds(250);

  /// Reads device, connector, mode, bits, bits_fallback, buffers ("auto", "gpu", "mapped") and
  /// state_directory.
  /// @param state_directory  where the table says none; empty: the first folder of the
  /// environment's
  ///                         STATE_DIRECTORY.
  /// Errors: kInvalidOption, kNotFound, kIo, kUnavailable (nothing connected; another program has
  /// the card; 10 bits are refused).
  [[nodiscard]] static Result<std::unique_ptr<KmsOutput>> open(
      TomlReader& config, const std::filesystem::path& state_directory);
  /// Opens what the options ask for of these cards.
  /// @param clock  of the device's flips; borrowed, must outlive the output.
  [[nodiscard]] static Result<std::unique_ptr<KmsOutput>> open(const KmsOutputOptions& options,
                                                               const KmsCards& cards,
                                                               Clock& clock);
  [[nodiscard]] static Result<std::unique_ptr<KmsOutput>> open(const KmsOutputOptions& options,
                                                               std::unique_ptr<KmsDevice> device,
                                                               Clock& clock);
  /// Shows black and brings the colour tables back.
  ~KmsOutput() override;
  KmsOutput(const KmsOutput&) = delete;
  KmsOutput& operator=(const KmsOutput&) = delete;

  [[nodiscard]] std::string description() const override;
  [[nodiscard]] bool wants_pixels(std::uint64_t /*frame_number*/) const override {
    return scanout_.buffers.empty();
  }
  /// Waits for the frame before it to be on the screen, if it is not yet.
  /// Errors: as Output; kInvalidOption (another size than the mode's, more bits than the
  /// buffers'), kTimeout (the card hangs: kFlipTimeout has passed), kDisconnected (the card is
  /// gone).
  [[nodiscard]] Status present(const Frame& frame) override;
  [[nodiscard]] Status finish() override;
  [[nodiscard]] std::uint64_t waits() const override { return waits_; }
  /// Waits for a frame that is under way, which takes a refresh at most.
  [[nodiscard]] Status blank() override;
  [[nodiscard]] std::optional<Presented> last_presented() override;
  [[nodiscard]] std::optional<Duration> refresh_period() const override { return period_; }
  [[nodiscard]] const Scanout* scanout() const override {
    return scanout_.buffers.empty() ? nullptr : &scanout_;
  }
  [[nodiscard]] Result<std::size_t> next_buffer() override;
  void give_up_scanout() override;

  [[nodiscard]] int bits() const { return bits_; }
  [[nodiscard]] const DisplayChoice& display() const { return display_; }

 private:
  static constexpr std::size_t kBuffers = 3;  // one is shown, one waits, one is drawn into
  static constexpr std::size_t kBlack = kBuffers;

  struct Pending {
    std::uint64_t token = 0;
    std::size_t buffer = kBlack;
    std::optional<std::uint64_t> frame;
  };
  enum class Trouble { kNone, kMaster, kUnplugged };

  KmsOutput(const KmsOutputOptions& options, std::unique_ptr<KmsDevice> device, Clock& clock);
  [[nodiscard]] Status begin(const KmsOutputOptions& options);
  [[nodiscard]] Status choose_bits(const KmsOutputOptions& options);
  [[nodiscard]] Status make_black(int bits);
  [[nodiscard]] Status make_buffers(KmsMemory memory);
  [[nodiscard]] Result<std::vector<KmsSetting>> full_settings(KmsId framebuffer, int bits);
  [[nodiscard]] Status configure(std::size_t buffer);
  [[nodiscard]] Status become_ready();
  [[nodiscard]] Status find_display_again(bool ask);
  [[nodiscard]] Status trouble_with(int refused, std::string_view doing);
  [[nodiscard]] Status unavailable() const;
  void take(const KmsFlip& flip);
  void take_flips();
  [[nodiscard]] Status wait_for_pending();
  [[nodiscard]] Status flip_to(std::size_t buffer, std::optional<std::uint64_t> frame);
  [[nodiscard]] std::size_t free_buffer() const;
  [[nodiscard]] std::string doing() const;

  std::unique_ptr<KmsDevice> device_;
  Clock& clock_;
  ColourKeeper keeper_;
  bool by_identity_ = false;  // the display was asked for, not the socket
  DisplayChoice display_;
  Duration period_{};
  int bits_ = 8;
  KmsId mode_blob_ = 0;
  KmsId framebuffer_property_ = 0;
  std::array<KmsBuffer, kBuffers + 1> buffers_;  // the last one is black
  Scanout scanout_;                              // its buffers are empty while pixels are written

  std::size_t shown_ = kBlack;
  std::optional<Pending> pending_;
  std::uint64_t next_token_ = 1;
  std::optional<Presented> presented_;
  std::uint64_t waits_ = 0;

  Trouble trouble_ = Trouble::kNone;
  std::string trouble_text_;
  Time next_attempt_;
  std::optional<Error> broken_;  // what give_up_scanout() could not return
};

}  // namespace veneer::projector
