// Converts reports of stages to messages of the protocol.
#pragma once

#include "firmware/calibration/calibration_keeper.h"
#include "firmware/capture/capture.h"
#include "firmware/config/config.h"
#include "firmware/frame/raymap.h"
#include "firmware/hosts/client.h"
#include "firmware/hosts/device_scan.h"
#include "firmware/operate/audit_log.h"
#include "firmware/picture/blender.h"
#include "firmware/record/take_messages.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// Text of devices, files and hosts, made printable and cut to 1000 bytes for a message.
std::string shown(std::string_view text);
void fill_exposure(const ExposureControl::Report& exposure, std::size_t heads, wire::ExposureState& into);
void fill_genlock(const RigConfig& config, const GenlockReport& genlock, wire::Genlock& into);
void fill_heads(const RigConfig& config, const CaptureReport& capture, const Blender& blender, wire::Heads& into);
/// Frames, sets and genlock.
void fill_capture(const RigConfig& config, const CaptureReport& capture, wire::RigStatus& into);
/// The evidence of how well the set of this raymap was exposed together.
void fill_sync(const RaymapInfo& info, wire::RaymapHeader& into);
void fill_calibrations(const CalibrationAnswer::Listed& listed, wire::Calibrations& into);
void fill_trial(const Trial& trial, Instant now, wire::Trial& into);
void fill_takes(const TakeAnswer::Listed& listed, wire::Takes& into);
void fill_disk_test(const TakeAnswer::DiskTested& tested, wire::DiskTested& into);
void fill_recording(const TakeReport& takes, Instant now, wire::Recording& into);
/// At most kMaxAuditReply entries: 256 with texts of kMaxAuditText bytes are below 300 KiB.
inline constexpr std::size_t kMaxAuditReply = 256;
void fill_audit(const AuditLog& log, const wire::AuditLogRequest& wanted, Instant start, Instant now,
                std::int64_t utc_ns, wire::AuditLog& into);
/// The connected hosts; `asking` is the one that sent the request.
void fill_hosts(const Clients& clients, const Client& asking, Instant now, wire::Hosts& into);
/// A message's text has one line; the list's text has many.
void fill_devices(const DeviceList& list, wire::Devices& into);
void add_count(google::protobuf::RepeatedPtrField<wire::Count>& into, std::string_view reason, std::uint64_t count);

}  // namespace nodal::firmware
