// A process of clients that attack a nodald at its socket, all ways at once, at bounded rates and the lowest priority.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

namespace nodal::crash {

/// What they do beside loading the rig.
enum class Attack : std::uint8_t {
  kLoad,    ///< nothing: no setting changes
  kChange,  ///< they change what a control client may: rates, exposures, and calibrations with names that forge lines
};

/// Forked from a program of one thread; its end is killed with the object, and with the program.
///
/// Threading: thread-bound.
/// Ownership: owns the process.
/// Errors: running() is false when it could not be started, or died.
class Attackers {
 public:
  /// `document`: the calibration that is in force.
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
