// What emulated USB cameras share: raw-gadget's device, and a process of their own.
#pragma once

#include <linux/usb/ch9.h>
#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <span>
#include <utility>
#include <vector>

namespace nodal::hil {

using Bytes = std::vector<std::uint8_t>;

/// Appends a number, low byte first.
void put(Bytes& to, std::uint32_t value, int bytes);
/// A descriptor of numbers and their sizes; its first byte becomes its length.
Bytes descriptor(std::initializer_list<std::pair<std::uint32_t, int>> fields);
/// String descriptor `index`, counted from 1; 0 lists the languages.
Bytes string_descriptor(unsigned index, std::span<const char* const> texts);

/// A device on dummy_hcd, with one bulk endpoint. A failed call ends the process.
///
/// Threading: write() on one thread, the others on another.
class RawGadget {
 public:
  static constexpr std::uint8_t kStream = 0x81;     ///< the endpoint
  static constexpr std::uint32_t kMaxBytes = 4096;  ///< limit of a write, and of a request's data

  /// `controller`: of dummy_hcd, from 0.
  explicit RawGadget(int controller = 0);
  [[noreturn]] static void end(const char* where);

  usb_ctrlrequest next_request();
  void stall();
  bool give(const Bytes& bytes, unsigned most);
  /// The data of a request, or its acknowledgement.
  Bytes take(unsigned length);
  /// Answers SET_CONFIGURATION.
  void configure();
  /// 0 or an errno: EINTR after a signal.
  int write(std::span<const std::uint8_t> bytes);

 private:
  const int fd_;
  int endpoint_ = -1;
};

/// Zeroed memory that processes share.
void* shared_memory(std::size_t bytes);
/// Runs `run` in a process of its own, which is killed with this one.
pid_t start_process(const std::function<void()>& run);
/// Kills it, which is what pulling a plug does.
void kill_process(pid_t process);

}  // namespace nodal::hil
