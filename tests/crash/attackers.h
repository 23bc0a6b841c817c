// A process of clients that attack a nodald's socket in all ways at once, at bounded rates and the lowest priority.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

namespace nodal::crash {

/// The attackers' changes, besides the load.
enum class Attack : std::uint8_t {
  kLoad,    ///< no changes of settings
  kChange,  ///< changes as by a control client: rates, exposures, and calibrations with line breaks in their names
};

/// Forked from a single-threaded program; killed by the destructor and at the program's end.
///
/// Threading: thread-bound.
/// Ownership: owns the process.
/// Errors: running() is false if it could not be started, or died.
class Attackers {
 public:
  /// `document`: the calibration in force.
  Attackers(Attack attack, const std::string& socket, const std::string& document);
  ~Attackers();
  Attackers(const Attackers&) = delete;
  Attackers& operator=(const Attackers&) = delete;

  bool running();
  /// CPU time it has used, in seconds.
  double cpu_seconds() const;

 private:
  pid_t pid_ = -1;
};

}  // namespace nodal::crash
