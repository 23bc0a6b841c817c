// The rig's commands as the wire has them.
#pragma once

#include "firmware/config/config.h"
#include "firmware/operate/commands.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// The command that a request asks for: one that changes_rig() or needs_keeper(), but for upload_commit, whose document is
/// not in the request. Values keep their meaning, and those that the rig's types cannot hold are errors here; what is
/// allowed of the others is check()'s to say. Errors: kBadValue, kMissingField, kUnsupported.
Result<Command> command_of(const wire::Request& request, const RigConfig& config);
/// An upload_commit, still without its document. Errors: kTooLarge.
Result<KeeperRequest::Install> install_of(const wire::UploadCommit& commit);

/// Everything but its id.
wire::Reply reply_of(const Answer& answer, const RigConfig& config);

}  // namespace nodal::firmware
