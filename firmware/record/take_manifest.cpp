#include "firmware/record/take_manifest.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "firmware/record/stored_documents.h"
#include "firmware/storage/durable_file.h"
#include "protocol/base/try.h"
#include "protocol/take/digest.h"
#include "stitch/media/thumbnail.h"

namespace nodal::firmware {

void ManifestSum::add(const FinishedSegment& segment) {
  const Duration most = Duration::nanoseconds(take::kMaxTimeNs);
  manifest_.sets += segment.sets;
  manifest_.length = std::min(most, manifest_.length + std::min(most, segment.length + segment.tally.rate().period()));
  manifest_.files.insert(manifest_.files.end(), segment.files.begin(), segment.files.end());
  manifest_.marks.insert(manifest_.marks.end(), segment.marks.begin(), segment.marks.end());
  manifest_.calibrations = segment.calibrations;
  tally_.add(segment.tally);
}

bool ManifestSum::has_room(const FinishedSegment& segment) const {
  return manifest_.files.size() + segment.files.size() + kOtherFiles <= take::kMaxTakeFiles;
}

take::Manifest ManifestSum::finish(std::uint64_t recorded) {
  manifest_.deleted_sets = recorded - std::min(recorded, manifest_.sets);
  manifest_.gaps = tally_.gaps();
  manifest_.lost_sets = manifest_.gaps.slow + manifest_.gaps.error;
  manifest_.heads.assign(tally_.heads().begin(), tally_.heads().begin() + static_cast<std::ptrdiff_t>(heads_));
  manifest_.rates = tally_.rates();
  return std::move(manifest_);
}

Result<take::Manifest> write_manifest(hal::DiskPort& disk, const std::string& folder, take::Manifest manifest) {
  std::vector<std::string> names{take::kTakeFile, take::kRigFile, take::kCalibrationFile, take::kThumbFile};
  for (const take::Manifest::Calibration& calibration : manifest.calibrations) {
    if (calibration.stored()) names.push_back(calibration.file);
  }
  for (const std::string& name : names) {
    const auto bytes = disk.read(folder + "/" + name, kMaxDocumentBytes);
    if (!bytes && bytes.error().code == Errc::kNotFound) continue;
    if (!bytes) return fail(bytes.error());
    if (name == take::kThumbFile && !media::is_whole_jpeg(*bytes)) {  // the power went while it was written
      NODAL_TRY(disk.remove(folder + "/" + name));
      continue;
    }
    take::PieceHashes hashes;
    hashes.update(*bytes);
    manifest.files.push_back({name, bytes->size(), take::digest_of(hashes.all())});
  }
  std::ranges::sort(manifest.files, {}, &take::Manifest::File::name);
  NODAL_TRY(disk.sync_all());
  return store_manifest(disk, folder, std::move(manifest), Stored::kNew);
}

Result<take::Manifest> store_manifest(hal::DiskPort& disk, const std::string& folder, take::Manifest manifest,
                                      Stored how) {
  const std::string name = folder + "/" + take::kManifestFile;
  const std::string text = take::manifest_json(take::within_limits(std::move(manifest)));
  if (const auto parsed = take::parse_manifest(text, name); !parsed) return fail(parsed.error().in("to be written"));
  NODAL_TRY(how == Stored::kNew ? create_durably(disk, folder, name, text) : write_durably(disk, folder, name, text));
  return stored_manifest(disk, folder);
}

}  // namespace nodal::firmware
