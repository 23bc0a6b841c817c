// Converts requests of the protocol to commands, and answers to replies.
#pragma once

#include "firmware/config/config.h"
#include "firmware/operate/commands.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// The command for a request that changes_rig() or has a slow stage (RequestKind); not for upload_commit, whose
/// document is not in the request. A value that the rig's types cannot hold is an error here; check() of the command
/// then refuses values that are not allowed. Errors: kBadValue, kMissingField, kUnsupported.
Result<Command> command_of(const wire::Request& request, const RigConfig& config, std::uint64_t host);
/// The command for an upload_commit, without its document, which the caller adds. Errors: kTooLarge.
Result<CalibrationRequest::Install> install_of(const wire::UploadCommit& commit);

/// The reply for an answer; the caller sets its id.
wire::Reply reply_of(const Answer& answer, const RigConfig& config);

}  // namespace nodal::firmware
