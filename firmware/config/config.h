// rig.toml describes one rig. firmware/RIG.md explains every key and its limits.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/config/exposure_settings.h"
#include "hal/head.h"
#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/raymap_config.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"
#include "protocol/ssh_signature.h"

namespace nodal::firmware {

/// The kind of a head's port: the word before the colon in `port`.
enum class PortKind : std::uint8_t { kSim, kReplay, kTake, kV4l2, kIidc };

/// Whether frames come from files, so that pulses only step them.
constexpr bool is_replayed(PortKind kind) { return kind == PortKind::kReplay || kind == PortKind::kTake; }

/// "sim:cam0", "replay:pictures/cam0-*.png", "take:takes/000042/cam0", "v4l2:/dev/video0" or "iidc:00b09d0100c0ffee":
/// the kind of the port and its name.
struct PortAddress {
  PortKind kind = PortKind::kSim;
  /// What follows the colon; for replay a file or glob, for take its folder and a head, both relative to rig.toml.
  std::string name;
  /// As rig.toml has it.
  std::string text() const;
  friend bool operator==(const PortAddress&, const PortAddress&) = default;
};

enum class GpioPull : std::uint8_t { kNone, kUp, kDown };

/// "gpio:gpiochip0:17,low": a line of a GPIO chip.
struct GpioLine {
  std::string chip;  ///< its name or label
  std::uint32_t offset = 0;
  bool low = false;  ///< the low level is on, or pressed
  GpioPull pull = GpioPull::kNone;
  /// "gpio:gpiochip0:17".
  std::string text() const;
  friend bool operator==(const GpioLine&, const GpioLine&) = default;
};

/// What is requested from a device when it is opened, besides format, fields and rate.
struct DeviceConfig {
  int width = 0;  ///< with height; 0: as the device comes
  int height = 0;
  std::string input;                ///< empty: as the device comes
  std::string standard;             ///< empty: as the device comes
  std::int32_t gain_step_mdb = 0;   ///< 0: its gain is left as it is
  std::optional<Duration> readout;  ///< nothing: one frame period
  bool separate_fields = false;     ///< each field in a buffer of its own
  // The following fields are only for IIDC cameras.
  std::optional<int> left = {}, top = {};  ///< both or none: a rectangle of the sensor
  std::uint32_t packet_bytes = 0;          ///< 0: the smallest that carries the rate
  bool pulse_is_exposure = false;          ///< the width of the trigger's pulse; otherwise the camera's shutter
  friend bool operator==(const DeviceConfig&, const DeviceConfig&) = default;
};

/// How a take stores the pictures of a head.
enum class TakeMode : std::uint8_t {
  kDriver,    ///< as the head delivers them
  kRaw,       ///< MJPEG is decoded to what the blend reads
  kJpeg,      ///< those that are not coded become JPEGs
  kLossless,  ///< those that are not coded become Ut Video, which decodes to the same bytes
};

/// One [[heads]] entry; its position among them is its HeadIndex.
struct HeadConfig {
  std::string name;  ///< as in the calibration
  PortAddress port;
  PixelFormat format = PixelFormat::kI420;  ///< the format requested from the head
  /// Requested from the head when it is opened; empty: the head keeps its own value.
  std::optional<Exposure> exposure;
  std::optional<Gain> gain;
  std::optional<WhiteBalance> white_balance;
  std::optional<hal::Gamma> gamma;
  Fields fields = Fields::kProgressive;  ///< the field order that it delivers
  bool wired = false;                    ///< it follows the trigger's line, and its driver does not know of it
  Duration trigger_delay;                ///< from the trigger to this head's pulse; `wired`: to its exposure
  std::optional<GpioLine> trigger;       ///< the line that its pulses leave by; empty: TriggerConfig::port
  DeviceConfig device;                   ///< settings of the device, used with a v4l2: or iidc: port
  TakeMode take_mode = TakeMode::kDriver;
  int line = 0;  ///< line number in rig.toml, for error messages
};

/// What synchronizes the exposures of the heads.
enum class SyncSource : std::uint8_t {
  kOwn,       ///< pulses that the rig generates
  kExternal,  ///< pulses from outside, at the rig's rate
  kNone,      ///< no pulses: the heads run free, and the rig aligns the phases of their exposures
};

/// [trigger]
struct TriggerConfig {
  bool start = false;  ///< the genlock starts with the rig, without a request of a host
  Duration pulse_width = Duration::microseconds(100);
  bool active_high = true;
  SyncSource source = SyncSource::kOwn;
  std::optional<GpioLine> port;      ///< kOwn: the line of heads without one of their own; kExternal: the input
  std::optional<GpioLine> readback;  ///< an input that is wired to `port` and measures its pulses
};

/// [sim]: the simulated scene of the "sim:" heads.
struct SimConfig {
  enum class Scene : std::uint8_t { kProcedural, kConstant, kPhoto, kBar };
  enum class Clock : std::uint8_t {
    kReal,  ///< frames arrive in real time
    kFast,  ///< virtual time that advances as fast as the daemon works; no frame is dropped for overload
  };
  std::string calibration;  ///< file with the true calibration that the heads are rendered with
  Scene scene = Scene::kProcedural;
  std::string photo;                                    ///< kPhoto: path of an equirectangular JPEG or PNG
  std::array<std::uint8_t, 3> constant{128, 128, 128};  ///< kConstant: red, green, blue, encoded
  double noise = 0;                                     ///< standard deviation in levels of 255, 0 .. 64
  std::uint64_t seed = 1;
  Clock clock = Clock::kReal;
};

/// Permissions and group of a Unix socket's file.
struct SocketFile {
  std::optional<std::uint32_t> mode;  ///< permission bits, set exactly; empty: 0660 and not the umask's bits
  std::string group;                  ///< empty: nodald's group
};

/// [links]: the sockets that hosts connect to.
struct LinksConfig {
  std::string unix_path = "/run/nodal/nodal.sock";  ///< control; empty: no such socket
  SocketFile unix_file;
  std::string view_path;  ///< view only; empty: no such socket
  SocketFile view_file;
  std::string operate_path;  ///< to film, without the right to change what the rig is; empty: no such socket
  SocketFile operate_file;
  std::string usb_folder;  ///< FunctionFS folder of the USB cable, control; empty: no cable
};

/// [panel]: the ports of the rig's button and lamps; empty: not there.
struct PanelConfig {
  std::string button;
  std::string status;
  std::string tally;
  /// Only for buttons and lamps that are "gpio:" ports.
  std::optional<GpioLine> button_line, status_line, tally_line;
};

/// [takes]
struct TakesConfig {
  std::string folder;            ///< where takes are stored
  bool mounted = false;          ///< the folder must be the root of a mounted file system, such as a card
  int buffer_mb = 256;           ///< pictures on their way to the disk
  bool raymap = true;            ///< raymaps are recorded, too
  bool at_start = false;         ///< a take begins when nodald starts
  bool loop = false;             ///< when the disk is full, the oldest segments are deleted; else the take ends
  int quality = 90;              ///< quality of JPEGs, 1 .. 100
  bool flight_recorder = false;  ///< what capture's ports answer is recorded, too
};

/// A complete, checked rig.toml.
struct RigConfig {
  std::string name;
  FrameRate rate;
  RaymapConfig raymap;
  std::vector<HeadConfig> heads;
  TriggerConfig trigger;
  ExposureSettings exposure;     ///< [exposure]
  std::optional<SimConfig> sim;  ///< has a value exactly when a head is on a "sim:" port
  LinksConfig links;
  PanelConfig panel;
  std::string store = "/var/lib/nodal";     ///< folder of the calibration store
  std::string signers_file;                 ///< [calibration] signers; empty: calibrations need no signature
  std::optional<AllowedSigners> signers;    ///< parsed contents of that file; set after the file is read
  std::optional<TakesConfig> takes;         ///< empty: nothing is recorded
  Sha256 text_id{};                         ///< SHA-256 of rig.toml's text
  std::shared_ptr<const std::string> text;  ///< as it was read
};

inline constexpr std::size_t kMaxRigTomlBytes = 256 * 1024;

/// Parses and checks a rig.toml. Paths stay as written. `read_rays` reads the file that [raymap] layout = "rays:FILE"
/// names; without it such a layout is refused.
///
/// Errors: the first one, with `file:line:column`, the field, what is wrong and what is allowed; an unknown key
/// is an error that suggests the nearest known key.
Result<RigConfig> parse_rig_config(std::string_view text, std::string_view file, const ReadRayFile& read_rays = {});

}  // namespace nodal::firmware
