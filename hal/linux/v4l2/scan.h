// What every V4L2 capture device of the machine offers, without changing anything.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/linux/v4l2/system.h"
#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/units.h"

namespace nodal::hal::v4l2 {

struct FoundSize {
  int width = 0;
  int height = 0;
  std::vector<FrameRate> rates;  ///< descending; empty: the device does not list them
  bool rate_range = false;       ///< `rates` are the ends of a range
};

struct FoundFormat {
  std::string name;                   ///< its four characters
  std::optional<PixelFormat> pixels;  ///< nothing: heads cannot have this format
  std::vector<FoundSize> sizes;
  bool size_range = false;  ///< `sizes` are the ends of a range, and the present size
};

/// In the driver's units.
struct FoundControl {
  std::string name;
  std::int32_t low = 0, high = 0, step = 1, usual = 0;
};

/// Texts are printable.
struct FoundDevice {
  std::string node;  ///< "/dev/video0"
  /// What `port` of rig.toml takes: the bus, or the node if several devices have that bus.
  std::string port;
  bool second_stream = false;  ///< another node of a camera on USB, such as its compressed stream
  std::string model;
  std::string driver;
  std::optional<device::UsbPlace> usb;
  std::string input;                     ///< name of the input that is chosen; empty if it has none
  std::optional<FrameRate> standard;     ///< rate of the input's video standard
  Fields fields = Fields::kProgressive;  ///< field order of that standard
  std::vector<FoundFormat> formats;
  std::vector<FoundControl> controls;
  std::vector<std::string> oddities;  ///< what the driver reports and cannot be: sentences
  std::optional<Error> problem;       ///< why nothing else is known
  std::string listed_only;            ///< why its modes are not known, although nothing is wrong; otherwise empty
};

inline constexpr std::size_t kMaxNodes = 64;       ///< device nodes that a scan opens
inline constexpr int kMaxEnumerations = 4096;      ///< questions for formats, sizes and rates to one device
inline constexpr std::size_t kMaxFormats = 64;     ///< pixel formats kept of a device
inline constexpr std::size_t kMaxSizes = 64;       ///< frame sizes kept of a format
inline constexpr std::size_t kMaxFrameRates = 32;  ///< frame rates kept of a size

/// Asks devices, each on a thread of its own; also those that other programs use.
///
/// Threading: scan() on one thread at a time.
/// Ownership: a thread ends when its driver answers, so `system` must live that long; the Scanner need not.
class Scanner {
 public:
  explicit Scanner(System& system);
  /// Opens every node, asks it, and closes it, all nodes at once. A device that has not answered after `patience` is
  /// listed with a problem, and is not asked again until it has answered, so that a device that hangs occupies one
  /// thread.
  std::vector<FoundDevice> scan(std::chrono::milliseconds patience);

 private:
  struct Answers;
  bool ask(const std::string& node);

  System& system_;
  std::shared_ptr<Answers> answers_;
};

}  // namespace nodal::hal::v4l2
