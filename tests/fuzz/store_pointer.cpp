// The calibration store's folder with any content: the pointer and calibrations with changed, missing or added bytes,
// under valid and invalid names. The store opens, lists exactly the valid calibrations, has one of them in force, and
// continues to work; a whole rig starts on the same disk. The input: operations on the files of a valid store.
#include <algorithm>
#include <cstdio>

#include "firmware/calibration/calibration_store.h"
#include "tests/fuzz/stand.h"
#include "tests/fuzz/telling.h"

namespace {

using namespace nodal;
using namespace nodal::fuzz;

const std::string kFolder = "calibrations";
const std::string kPointer = kFolder + "/in-force";

std::string name_of(std::uint64_t generation, const Sha256& id) {
  std::array<char, 32> digits{};
  std::snprintf(digits.data(), digits.size(), "%08llu", static_cast<unsigned long long>(generation));
  return kFolder + "/" + digits.data() + "-" + to_hex(id) + ".json";
}

std::string document(std::size_t which) { return canonical_json(Stand::calibrations()[which % 2]); }

/// Truncates, extends or changes bytes.
void spoil(ByteReader& in, std::vector<std::uint8_t>& bytes) {
  const std::uint32_t where = in.u16();
  const std::uint8_t how = in.u8();
  const std::string with = text(in);
  const std::size_t at = bytes.empty() ? 0 : where % bytes.size();
  if (how % 3 == 0) bytes.resize(at);
  if (how % 3 == 1 && !bytes.empty()) bytes[at] ^= static_cast<std::uint8_t>(how | 1);
  bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes.size())), with.begin(), with.end());
}

void damage(ByteReader& in, hal::sim::SimDisk& disk) {
  switch (in.u8() % 6) {
    case 0: {  // the pointer
      const std::string bytes = text(in);
      return write_file(disk, kPointer, std::span(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()));
    }
    case 1: {  // a file of the store
      const auto names = disk.list(kFolder);
      if (!names || names->empty()) return;
      const std::string file = kFolder + "/" + (*names)[in.u8() % names->size()];
      auto bytes = disk.read(file, 1U << 20);
      if (!bytes) return;
      spoil(in, *bytes);
      return write_file(disk, file, *bytes);
    }
    case 2: {  // a valid calibration with any generation number
      const std::string json = document(in.u8());
      const std::span bytes(reinterpret_cast<const std::uint8_t*>(json.data()), json.size());
      return write_file(disk, name_of(telling(in), sha256(bytes)), bytes);
    }
    case 3: {  // any document under its correct name: the checksum does not detect it
      std::string json = document(in.u8());
      std::vector<std::uint8_t> bytes(json.begin(), json.end());
      spoil(in, bytes);
      return write_file(disk, name_of(telling(in), sha256(bytes)), bytes);
    }
    case 4: return write_file(disk, kFolder + "/" + text(in), {});
    default: (void)disk.remove(kPointer);
  }
}

/// The ids of files that have their correct name and can be parsed.
std::vector<Sha256> good_ones(hal::sim::SimDisk& disk) {
  std::vector<Sha256> good;
  for (const std::string& name : disk.list(kFolder).value_or(std::vector<std::string>{})) {
    const auto bytes = disk.read(kFolder + "/" + name, kMaxCalibrationBytes);
    if (!bytes || !name.ends_with(to_hex(sha256(*bytes)) + ".json")) continue;
    if (name.find_first_not_of("0123456789") != 8) continue;  // generations written by the store itself
    if (parse_calibration(std::string(bytes->begin(), bytes->end()))) good.push_back(sha256(*bytes));
  }
  return good;
}

bool lists(const firmware::CalibrationStore& store, const Sha256& id) {
  return std::any_of(store.entries().begin(), store.entries().end(), [&](const auto& entry) { return entry.id == id; });
}

void check_store(hal::sim::SimDisk& disk) {
  const std::vector<Sha256> good = good_ones(disk);
  auto store = firmware::CalibrationStore::open(disk);
  NODAL_ASSERT(store);
  for (const Sha256& id : good) NODAL_ASSERT(lists(*store, id));
  for (const auto& entry : store->entries()) NODAL_ASSERT(store->load(entry.id));
  NODAL_ASSERT(store->in_force().has_value() == !store->entries().empty());
  if (store->in_force()) NODAL_ASSERT(lists(*store, *store->in_force()));
  if (store->before()) NODAL_ASSERT(lists(*store, *store->before()));
  for (const Calibration& calibration : Stand::calibrations()) {
    const Sha256 id = calibration_id(calibration);
    const bool stored = store->put(calibration) && store->set_in_force(id);
    NODAL_ASSERT(stored && store->in_force() == id);
  }
  NODAL_ASSERT(store->before() == calibration_id(Stand::calibrations()[0]));
  NODAL_ASSERT(store->set_in_force(Sha256(*store->before())));
  const auto again = firmware::CalibrationStore::open(disk);
  NODAL_ASSERT(again && again->in_force() == store->in_force() && again->before() == store->before());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(std::span(data, size));
  auto disk = Stand::new_disk();
  const bool whole_rig = in.u8() % 64 == 1;  // costs a hundred times as much
  for (int i = 0; i < 16 && in.left() > 0; ++i) damage(in, *disk);
  const auto same = disk->after_kill();
  check_store(*same);
  if (!whole_rig) return 0;
  Stand stand(std::move(disk));
  Guest& host = stand.connect();
  wire::Request request;
  request.mutable_calibration_list();
  const wire::Calibrations listed = stand.ask(host, request).calibrations();
  for (const wire::CalibrationEntry& entry : listed.entries()) {
    request.mutable_calibration_use()->set_id(entry.id());
    (void)stand.ask(host, request);  // one that does not fit this rig is refused
  }
  request.mutable_calibration_rollback();
  (void)stand.ask(host, request);
  stand.check();
  stand.check_recovery();
  return 0;
}
