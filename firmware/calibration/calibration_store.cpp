#include "firmware/calibration/calibration_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <functional>
#include <sstream>

#include "firmware/storage/durable_file.h"
#include "protocol/base/try.h"
#include "protocol/ssh_signature.h"

namespace nodal::firmware {

std::string short_id(const Sha256& id) { return to_hex(id).substr(0, 12); }

namespace {

const std::string kFolder = "calibrations";
const std::string kPointer = kFolder + "/in-force";
constexpr std::string_view kPointerHead = "nodal-in-force 1";
constexpr std::size_t kMaxPointerBytes = 512;
const std::string kSignedFile = kFolder + "/signed";
constexpr std::string_view kSignedHead = "nodal-signed 1";
constexpr std::string_view kJson = ".json";
constexpr std::string_view kSigned = ".signed";
constexpr std::string_view kSignatureEnd = "-----END SSH SIGNATURE-----";
constexpr std::size_t kGenerationDigits = 8;

std::optional<Sha256> from_hex(std::string_view hex) {
  Sha256 id{};
  if (hex.size() != 2 * id.size()) return std::nullopt;
  for (std::size_t i = 0; i < id.size(); ++i) {
    const char* two = hex.data() + 2 * i;
    const auto [end, error] = std::from_chars(two, two + 2, id[i], 16);
    if (error != std::errc{} || end != two + 2) return std::nullopt;
  }
  return id;
}

struct FileName {
  std::uint64_t generation = 0;
  Sha256 id{};
};

/// "00000007-<id>.json", or nothing.
std::optional<FileName> parse_file_name(std::string_view name) {
  FileName parsed;
  const std::size_t dash = name.find('-');
  if (dash < kGenerationDigits || dash == std::string_view::npos || !name.ends_with(kJson)) return std::nullopt;
  const auto [end, error] = std::from_chars(name.data(), name.data() + dash, parsed.generation);
  if (error != std::errc{} || end != name.data() + dash) return std::nullopt;
  const auto id = from_hex(name.substr(dash + 1, name.size() - dash - 1 - kJson.size()));
  if (!id) return std::nullopt;
  parsed.id = *id;
  return parsed;
}

std::string signed_file(const std::string& file) {
  return file.substr(0, file.size() - kJson.size()) + std::string(kSigned);
}

std::string file_name(std::uint64_t generation, const Sha256& id) {
  const std::string digits = std::to_string(generation);
  const std::string zeros(kGenerationDigits - std::min(kGenerationDigits, digits.size()), '0');
  return kFolder + "/" + zeros + digits + "-" + to_hex(id) + std::string(kJson);
}

}  // namespace

Result<CalibrationStore> CalibrationStore::open(hal::DiskPort& disk) {
  CalibrationStore store(disk);
  if (Status made = disk.make_folder(kFolder); !made && made.error().code != Errc::kExists) return fail(made.error());
  // Syncs the parent first: otherwise a crash could lose the folder with everything in it.
  NODAL_TRY(disk.sync_folder(""));
  store.parse_pointer();
  NODAL_TRY(store.read_folder());
  store.follow_pointer();
  store.read_signed();
  return store;
}

Status CalibrationStore::read_folder() {
  NODAL_TRY_ASSIGN(const auto names, disk_->list(kFolder));
  std::vector<Entry> stored;
  for (const std::string& name : names) {
    const std::string file = kFolder + "/" + name;
    if (name.ends_with(kTemporarySuffix)) {
      (void)disk_->remove(file);  // left by a crash; if it cannot be removed, the next write overwrites it
      continue;
    }
    const auto parsed = parse_file_name(name);
    if (!parsed) continue;
    next_generation_ = std::max(next_generation_, parsed->generation + 1);
    stored.push_back({parsed->generation, parsed->id, "", 0, file});
  }
  std::ranges::sort(stored, std::greater(), &Entry::generation);
  for (std::size_t k = 0; k < stored.size(); ++k) {
    const bool wanted = stored[k].id == pointed_at_ || stored[k].id == before_;
    if (k < kMaxRead || wanted) read_entry(std::move(stored[k]));
    else damaged_.push_back(stored[k].file);
  }
  for (const std::string& name : names) {
    if (name.ends_with(kSigned)) drop_if_orphan(kFolder + "/" + name);
  }
  drop_copies();
  return {};
}

void CalibrationStore::read_entry(Entry found) {
  const auto calibration = load(found);
  if (!calibration) {
    damaged_.push_back(found.file);
    return add_note("stored calibration " + short_id(found.id) + " cannot be used: " + calibration.error().message);
  }
  found.name = calibration->name;
  found.heads = calibration->heads.size();
  entries_.push_back(std::move(found));
}

/// Marks duplicates for removal: the same calibration under an older generation, which a person made by copying files.
void CalibrationStore::drop_copies() {
  std::vector<Entry> kept;
  for (const Entry& entry : entries_) {
    const bool copy = std::any_of(kept.begin(), kept.end(), [&](const Entry& newer) { return newer.id == entry.id; });
    if (copy) damaged_.push_back(entry.file);
    else kept.push_back(entry);
  }
  entries_ = std::move(kept);
}

/// Removes a signature without a calibration: a crash came between the two writes, or between the two removals.
void CalibrationStore::drop_if_orphan(const std::string& file) {
  const bool stored = std::ranges::any_of(entries_, [&](const Entry& e) { return signed_file(e.file) == file; });
  const bool damaged = std::ranges::any_of(damaged_, [&](const std::string& d) { return signed_file(d) == file; });
  if (!stored && !damaged) (void)disk_->remove(file);
}

void CalibrationStore::parse_pointer() {
  const auto bytes = disk_->read(kPointer, kMaxPointerBytes);
  if (!bytes) return;
  std::istringstream text(std::string(bytes->begin(), bytes->end()));
  std::string head, now, before;
  std::getline(text, head);
  text >> now >> before;
  if (head != kPointerHead) return;
  pointed_at_ = from_hex(now);
  before_ = from_hex(before);
}

void CalibrationStore::follow_pointer() {
  const std::optional<Sha256>& wanted = pointed_at_;
  if (wanted && entry(*wanted)) {
    in_force_ = wanted;
  } else if (!entries_.empty()) {
    in_force_ = entries_.front().id;
    add_note((wanted ? "calibration " + short_id(*wanted) + " was in force and is no longer stored"
                     : std::string("the record of the calibration in force is lost or damaged")) +
             "; the newest good one, " + short_id(*in_force_) + ", is in force instead");
  } else if (wanted) {
    add_note("calibration " + short_id(*wanted) + " was in force and is no longer stored; upload it again");
  }
  if (before_ && !entry(*before_)) before_.reset();
}

void CalibrationStore::read_signed() {
  const auto bytes = disk_->read(kSignedFile, kMaxPointerBytes);
  if (!bytes && bytes.error().code == Errc::kNotFound) return;
  std::istringstream text(bytes ? std::string(bytes->begin(), bytes->end()) : std::string());
  std::string head;
  std::getline(text, head);
  if (head == kSignedHead && text >> signed_generation_) return;
  signed_generation_ = 0;
  add_note("the record of the highest signed generation is lost or damaged; upload the newest calibration again");
}

Status CalibrationStore::note_signed(std::uint64_t generation) {
  if (generation <= signed_generation_) return {};
  const std::string text = fmt::format("{}\n{}\n", kSignedHead, generation);
  NODAL_TRY(write_durably(*disk_, kFolder, kSignedFile, text));
  signed_generation_ = generation;
  return {};
}

const CalibrationStore::Entry* CalibrationStore::entry(const Sha256& id) const {
  const auto found = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.id == id; });
  return found == entries_.end() ? nullptr : &*found;
}

void CalibrationStore::add_note(const std::string& sentence) {
  if (!note_.empty()) note_ += "; ";
  note_ += sentence;
}

Result<CalibrationStore::Entry> CalibrationStore::put(const Calibration& calibration,
                                                      const std::optional<SignedDocument>& original) {
  const Sha256 id = calibration_id(calibration);
  const Entry* const stored = entry(id);
  Entry added{next_generation_, id, calibration.name, calibration.heads.size(), file_name(next_generation_, id)};
  if (original) {
    // The signature is written first: a rig that requires signatures cannot use a calibration without one.
    const std::string file = signed_file(stored ? stored->file : added.file);
    const std::string signature = original->signature.substr(0, original->signature.find(kSignatureEnd));
    const std::string text = signature + std::string(kSignatureEnd) + "\n" + original->json;
    NODAL_TRY(write_durably(*disk_, kFolder, file, text));
  }
  if (stored) return *stored;
  NODAL_TRY(write_durably(*disk_, kFolder, added.file, canonical_json(calibration)));
  ++next_generation_;
  entries_.insert(entries_.begin(), added);
  return added;
}

Status CalibrationStore::write_pointer(const std::optional<Sha256>& in_force, const std::optional<Sha256>& before) {
  std::string text(kPointerHead);
  text += "\n" + (in_force ? to_hex(*in_force) : "-") + "\n" + (before ? to_hex(*before) : "-") + "\n";
  return write_durably(*disk_, kFolder, kPointer, text);
}

Status CalibrationStore::set_in_force(const Sha256& id) {
  if (!entry(id)) return fail(Errc::kNotFound, "calibration " + short_id(id) + " is not stored here");
  if (in_force_ == id) return write_pointer(id, before_);  // the pointer on the disk may still name a skipped one
  if (Status written = write_pointer(id, in_force_); !written) {
    // The rename may have happened and only the sync failed. Writes the old pointer again, if the disk still works.
    if (written.error().code != Errc::kDiskFull) (void)write_pointer(in_force_, before_);
    return written;
  }
  before_ = in_force_;
  in_force_ = id;
  prune();
  return {};
}

void CalibrationStore::remove(const Sha256& id) {
  if (in_force_ == id || before_ == id) return;
  const Entry* stored = entry(id);
  if (!stored) return;
  (void)disk_->remove(stored->file);
  (void)disk_->remove(signed_file(stored->file));
  entries_.erase(entries_.begin() + (stored - entries_.data()));
}

void CalibrationStore::prune() {
  while (!damaged_.empty() && entries_.size() + damaged_.size() > kKept) {
    (void)disk_->remove(damaged_.front());
    (void)disk_->remove(signed_file(damaged_.front()));
    damaged_.erase(damaged_.begin());
  }
  for (std::size_t i = entries_.size(); i > 0 && entries_.size() > kKept; --i) {
    remove(Sha256(entries_[i - 1].id));
  }
  (void)disk_->sync_folder(kFolder);  // on failure a removed file may return after a crash; it is then removed again
}

Result<CalibrationStore::Entry> CalibrationStore::find(std::string_view id_prefix) const {
  const Entry* found = nullptr;
  for (const Entry& candidate : entries_) {
    if (!std::equal(id_prefix.begin(), id_prefix.end(), candidate.id.begin(),
                    candidate.id.begin() + static_cast<std::ptrdiff_t>(std::min(id_prefix.size(), candidate.id.size())),
                    [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; })) {
      continue;
    }
    if (found) {
      return fail(Errc::kBadValue, "calibrations " + short_id(found->id) + " and " + short_id(candidate.id) +
                                       " both have this prefix; give more of the id");
    }
    found = &candidate;
  }
  if (!found) return fail(Errc::kNotFound, "no stored calibration has that id; `nodal calibration list` shows all");
  return *found;
}

Result<std::string> CalibrationStore::read(const Sha256& id) const {
  const Entry* stored = entry(id);
  if (!stored) return fail(Errc::kNotFound, "calibration " + short_id(id) + " is not stored here");
  return read(*stored);
}

Result<std::string> CalibrationStore::read(const Entry& entry) const {
  NODAL_TRY_ASSIGN(const auto bytes, disk_->read(entry.file, kMaxCalibrationBytes));
  if (sha256(bytes) != entry.id)
    return fail(Errc::kChecksum, entry.file + " is damaged: its SHA-256 differs from the one in its name");
  return std::string(bytes.begin(), bytes.end());
}

Result<std::optional<SignedDocument>> CalibrationStore::original(const Sha256& id) const {
  const Entry* stored = entry(id);
  if (!stored) return fail(Errc::kNotFound, "calibration " + short_id(id) + " is not stored here");
  const auto bytes = disk_->read(signed_file(stored->file), kMaxSignatureBytes + kMaxCalibrationBytes);
  if (!bytes && bytes.error().code == Errc::kNotFound) return std::nullopt;
  if (!bytes) return fail(bytes.error());
  const std::string text(bytes->begin(), bytes->end());
  const std::size_t border = text.find('\n', std::min(text.find(kSignatureEnd), text.size()));
  if (border == std::string::npos) return fail(Errc::kChecksum, signed_file(stored->file) + " is damaged");
  return SignedDocument{text.substr(0, border), text.substr(border + 1)};
}

Result<Calibration> CalibrationStore::load(const Sha256& id) const {
  const Entry* stored = entry(id);
  if (!stored) return fail(Errc::kNotFound, "calibration " + short_id(id) + " is not stored here");
  return load(*stored);
}

Result<Calibration> CalibrationStore::load(const Entry& entry) const {
  NODAL_TRY_ASSIGN(const auto text, read(entry));
  auto calibration = parse_calibration(text);
  if (!calibration) return fail(calibration.error().in("calibration " + short_id(entry.id)));
  return calibration;
}

}  // namespace nodal::firmware
