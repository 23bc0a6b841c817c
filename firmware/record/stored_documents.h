// The documents of takes on a disk, read in pieces.
//
// The evidence is read where takes are recovered, in a process without rights. take.json and manifests are read in
// nodald, because the list of takes must follow the disk at once: what is deleted, protected or recorded next depends
// on it. SECURITY.md has the reasons.
#pragma once

#include <string>

#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {

/// The manifest of the take in a folder. Errors: the disk's, take::parse_manifest()'s.
Result<take::Manifest> stored_manifest(hal::DiskPort& disk, const std::string& folder);
/// Its SHA-256, which identifies the take. Errors: the disk's; kTooLarge for more than take::kMaxManifestBytes.
Result<Sha256> stored_manifest_id(hal::DiskPort& disk, const std::string& folder);
/// Errors: the disk's, take::parse_take_json()'s.
Result<take::TakeDocument> stored_take_json(hal::DiskPort& disk, const std::string& folder);
/// The evidence of a segment, `name` being its file. Errors: the disk's, take::EvidenceReader's.
Result<take::Segment> stored_evidence(hal::DiskPort& disk, const std::string& name);

}  // namespace nodal::firmware
