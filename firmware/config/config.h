// rig.toml: what this rig is made of. Every key is explained with its limits in firmware/RIG.md.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/config/exposure_settings.h"
#include "hal/head.h"
#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"
#include "protocol/ssh_signature.h"

namespace nodal::firmware {

/// What kind of port a head, trigger or world is on: the word before the colon in `port`.
enum class PortKind : std::uint8_t { kSim, kReplay, kV4l2 };

/// "sim:cam0" or "replay:pictures/cam0-*.png" or "v4l2:/dev/video0": which kind, and who there.
struct PortAddress {
  PortKind kind = PortKind::kSim;
  std::string name;  ///< what follows the colon; for replay a file or glob, relative to rig.toml
  /// As rig.toml has it.
  std::string text() const;
  friend bool operator==(const PortAddress&, const PortAddress&) = default;
};

/// What a V4L2 device is asked when it is opened, besides format, fields and rate.
struct DeviceConfig {
  int width = 0;  ///< with height; 0: as the device comes
  int height = 0;
  std::string input;                ///< empty: as the device comes
  std::string standard;             ///< likewise
  std::int32_t gain_step_mdb = 0;   ///< 0: its gain is left as it is
  std::optional<Duration> readout;  ///< nothing: one frame period
  friend bool operator==(const DeviceConfig&, const DeviceConfig&) = default;
};

/// One [[heads]] entry; its place among them is its HeadIndex.
struct HeadConfig {
  std::string name;  ///< as in the calibration
  PortAddress port;
  PixelFormat format = PixelFormat::kI420;  ///< what the head is asked to deliver
  /// What is asked of the head when it is opened; nothing: as the head comes.
  std::optional<Exposure> exposure;
  std::optional<Gain> gain;
  std::optional<WhiteBalance> white_balance;
  std::optional<hal::Gamma> gamma;
  Fields fields = Fields::kProgressive;  ///< what it delivers
  Duration trigger_delay;                ///< of its pulse after the trigger
  DeviceConfig device;                   ///< of a v4l2: port
  int line = 0;                          ///< in rig.toml, for messages
};

enum class RaymapLayout : std::uint8_t { kEquirectangular, kCube };
/// "equirectangular", "cube": as rig.toml and the wire have it.
std::string_view raymap_layout_name(RaymapLayout layout);

/// What becomes of interlaced frames.
enum class FieldUse : std::uint8_t {
  kWeave,     ///< both fields' rows in one raymap, as if they were one exposure
  kSeparate,  ///< each field a raymap of its own, through a table for the rows it has
};

/// [raymap]
struct RaymapConfig {
  RaymapLayout layout = RaymapLayout::kEquirectangular;
  int width = 2048;
  int height = 1024;
  PixelFormat format = PixelFormat::kI420;  ///< is_raymap_format()
  int jpeg_quality = 85;                    ///< 1 .. 100
  double feather = 0.5;                     ///< 0.01 .. 1; see table::TableOptions
  bool soft = true;                         ///< highlights that darker heads saw are held back, not clipped
  FieldUse fields = FieldUse::kWeave;

  /// That a frame set makes.
  int raymaps_a_set() const { return fields == FieldUse::kSeparate ? 2 : 1; }
};

/// Who makes heads expose together.
enum class SyncSource : std::uint8_t {
  kOwn,       ///< the rig's own pulses
  kExternal,  ///< somebody else's, at the rig's rate
  kNone,      ///< no pulses: the heads run free, and are moved until they are in step
};

/// [trigger]
struct TriggerConfig {
  bool start = false;  ///< genlock at start, without a host's asking
  Duration pulse_width = Duration::microseconds(100);
  bool active_high = true;
  SyncSource source = SyncSource::kOwn;
};

/// [sim]: the world that "sim:" heads look at.
struct SimConfig {
  enum class Scene : std::uint8_t { kProcedural, kConstant, kPhoto, kBar };
  enum class Clock : std::uint8_t {
    kReal,  ///< frames come when they would
    kFast,  ///< virtual time, as fast as the daemon keeps up; nothing is dropped for slowness
  };
  std::string calibration;  ///< file with the truth the heads are rendered with
  Scene scene = Scene::kProcedural;
  std::string photo;                                    ///< kPhoto: an equirectangular JPEG or PNG
  std::array<std::uint8_t, 3> constant{128, 128, 128};  ///< kConstant: red, green, blue, encoded
  double noise = 0;                                     ///< standard deviation in levels of 255, 0 .. 64
  std::uint64_t seed = 1;
  Clock clock = Clock::kReal;
};

/// Who may open a Unix socket.
struct SocketFile {
  std::optional<std::uint32_t> mode;  ///< permission bits, set exactly; nothing: 0660 less the umask
  std::string group;                  ///< empty: nodald's
};

/// [links]: where hosts connect.
struct LinksConfig {
  std::string unix_path = "/run/nodal/nodal.sock";  ///< empty: none
  SocketFile unix_file;
  std::string view_path;  ///< for viewing only; empty: none
  SocketFile view_file;
};

/// [panel]: the rig's own button and lamps, by where they are plugged in; empty: none.
struct PanelConfig {
  std::string button;
  std::string status;
  std::string tally;
};

/// A whole rig.toml, checked.
struct RigConfig {
  std::string name;
  FrameRate rate;
  RaymapConfig raymap;
  std::vector<HeadConfig> heads;
  TriggerConfig trigger;
  ExposureSettings exposure;     ///< [exposure]
  std::optional<SimConfig> sim;  ///< there exactly when a head is on a "sim:" port
  LinksConfig links;
  PanelConfig panel;
  std::string store = "/var/lib/nodal";   ///< folder of the calibration store
  std::string signers_file;               ///< [calibration] signers; empty: calibrations need no signature
  std::optional<AllowedSigners> signers;  ///< what that file says, once it was read
  Sha256 text_id{};                       ///< of rig.toml's text
};

inline constexpr std::size_t kMaxRigTomlBytes = 256 * 1024;

/// Reads and checks a rig.toml. Paths are left as they were written.
///
/// Errors: one, naming `file:line:column`, the field, what is wrong with it and what is allowed; an unknown key
/// is an error that names the nearest known one.
Result<RigConfig> parse_rig_config(std::string_view text, std::string_view file);

}  // namespace nodal::firmware
