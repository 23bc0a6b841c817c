// The ports of a rig.toml, made: heads, trigger, clock, disk, listeners, watchdog.
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
/// Errors: make() gives one that names the file, head or socket.
class World {
 public:
  /// `base` is rig.toml's folder, that paths in it count from. Reads what rig.toml names, and opens nothing.
  static Result<std::unique_ptr<World>> make(const firmware::RigConfig& config, const std::filesystem::path& base);
  ~World();

  /// Opens every device that rig.toml names and closes it again, which may take seconds. Errors: the first that cannot be
  /// opened as rig.toml asks, naming its head and line.
  Status check_devices(const firmware::RigConfig& config);
  /// What takes long and is better done before the first frame: simulated heads look at their scene.
  void prepare();
  /// Opens the store and the sockets.
  Status open_store(const std::filesystem::path& folder);
  Status listen(const firmware::LinksConfig& links);

  firmware::RigPorts ports();
  /// The trigger's line and the panel's lamps go to their safe levels for good. Any thread, whatever hangs.
  void make_safe() noexcept;
  /// Moves virtual time on; false when the clock is a real one.
  bool advance(Duration by);
  bool has_virtual_time() const;
  /// Where hosts can connect, for the log.
  std::vector<std::string> addresses() const;

 private:
  struct State;
  explicit World(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace nodal::daemon
