// Makes the ports that a rig.toml describes: heads, trigger, clock, disk, listeners, watchdog.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/rig.h"
#include "protocol/base/result.h"

namespace nodal::daemon {

/// Reads and checks a rig.toml. Errors: parse_rig_config()'s, kNotFound, kIo, all naming the file.
Result<firmware::RigConfig> read_rig_config(const std::filesystem::path& file);

/// Threading: make() and destruction on main; the ports as their headers say.
/// Ownership: owns every port; the rig that runs on them must be gone first.
/// Errors: make() returns one that names the file, head or socket.
class BoardPorts {
 public:
  /// `base` is rig.toml's folder; relative paths start there. Reads the files that rig.toml names, and opens no device.
  static Result<std::unique_ptr<BoardPorts>> make(const firmware::RigConfig& config, const std::filesystem::path& base);
  ~BoardPorts();

  /// Opens every device and every replayed picture that rig.toml names and closes it again, which may take seconds.
  /// Errors: the first that cannot be opened as rig.toml asks, naming its head and line.
  Status check_devices(const firmware::RigConfig& config);
  /// Errors: kExists if a program listens at one of the sockets.
  Status check_links(const firmware::LinksConfig& links) const;
  /// Claims the GPIO lines that rig.toml names, which may take long. Returns what could not be claimed, naming the key:
  /// a rig runs without it. Call it before ports().
  std::vector<Error> claim_lines(const firmware::RigConfig& config);
  /// What works less well than it could: sentences for the log.
  std::vector<std::string> notices() const;
  /// Does slow work before the first frame: renders the scene of simulated heads.
  void prepare();
  /// Opens the store and the sockets.
  Status open_store(const std::filesystem::path& folder);
  Status listen(const firmware::RigConfig& config);

  firmware::RigPorts ports();
  /// Sets the trigger's line and the panel's lamps to their safe levels permanently. Any thread, also while others
  /// hang.
  void make_safe() noexcept;
  /// Advances virtual time; false when the clock is real.
  bool advance(Duration by);
  bool has_virtual_time() const;
  /// The addresses that hosts can connect to, for the log.
  std::vector<std::string> addresses() const;

 private:
  struct State;
  explicit BoardPorts(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace nodal::daemon
