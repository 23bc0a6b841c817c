// The rig's end of the cable as the kernel presents it: one USB function with two bulk endpoints.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hal/linux/cable/records.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::hal::cable {

/// A control request, as the host sent it.
struct Setup {
  std::uint8_t type = 0;
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  std::uint16_t length = 0;
};

struct FunctionEvent {
  enum class Kind : std::uint8_t {
    kEnabled,   ///< a host configured the device: transfers can be queued
    kDisabled,  ///< the cable was unplugged, or the host reset the device: every transfer fails
    kSetup,     ///< a control request, to be answered or refused
    kOther,     ///< suspended, resumed, bound
  };
  Kind kind = Kind::kOther;
  Setup setup;
};

enum class Direction : std::uint8_t { kFromHost, kToHost };

/// The end of a queued transfer.
struct Completion {
  Direction direction = Direction::kFromHost;
  std::size_t slot = 0;
  std::int64_t result = 0;  ///< bytes, or a negative errno
};

/// Each direction has kTransfers slots, each with a buffer of kTransferBytes. A slot is queued until its completion was
/// returned; meanwhile its buffer must not be touched.
///
/// Threading: thread-bound to the control stage. No call waits, except wait().
/// Ownership: owns the buffers.
class UsbFunction {
 public:
  virtual ~UsbFunction() = default;
  /// The next event, or nothing; nothing between a request and its answer or refusal. Errors: kIo; final.
  virtual Result<std::optional<FunctionEvent>> next_event() = 0;
  /// Answers the last request, a device-to-host one. A host that no longer waits is no error.
  virtual void answer(std::span<const std::uint8_t> bytes) = 0;
  /// Refuses the last request by a stall.
  virtual void refuse(const Setup& setup) = 0;

  virtual std::span<std::uint8_t, kTransferBytes> buffer(Direction direction, std::size_t slot) = 0;
  /// False if the transfer could not be queued; it then has no completion.
  virtual bool queue_read(std::size_t slot) = 0;
  virtual bool queue_write(std::size_t slot, std::size_t bytes) = 0;
  /// Requests the end of all queued transfers; each still has its completion.
  virtual void cancel_all() = 0;
  virtual std::optional<Completion> next_completion() = 0;

  /// Readable when there may be an event or a completion.
  virtual int descriptor() const = 0;
  /// Waits for that.
  virtual void wait(Duration at_most) = 0;
};

}  // namespace nodal::hal::cable
