// The part of LinuxDisk that concerns the folder itself and the names in it.
#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <initializer_list>

#include "hal/folder_listing.h"
#include "hal/linux/disk.h"
#include "hal/linux/disk_parts.h"
#include "protocol/base/try.h"

namespace nodal::hal::linux_os {
namespace {

/// The umask may remove more.
constexpr mode_t kFolderMode = 0750;
/// Nobody but the owner may open the lock file: who opens a file can lock it.
constexpr mode_t kLockMode = 0600;

std::string folder_of(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  return slash == std::string::npos ? "." : name.substr(0, slash);
}
const char* last_part(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  return name.c_str() + (slash == std::string::npos ? 0 : slash + 1);
}

std::uint64_t mixed(std::initializer_list<std::uint64_t> values) {
  std::uint64_t hash = 14'695'981'039'346'656'037U;  // FNV-1a
  for (const std::uint64_t value : values) {
    for (int shift = 0; shift < 64; shift += 8) hash = (hash ^ ((value >> shift) & 0xFF)) * 1'099'511'628'211U;
  }
  return hash;
}

std::uint64_t nanoseconds(const timespec& time) {
  return static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000U + static_cast<std::uint64_t>(time.tv_nsec);
}

std::uint64_t version_of(const struct stat& about) {
  return mixed({about.st_dev, about.st_ino, nanoseconds(about.st_mtim), nanoseconds(about.st_ctim)});
}

/// f_fsid differs between file systems that come to have the same device and root, such as two cards in one reader.
std::uint64_t identity_of(const struct stat& folder, const struct statfs& system) {
  std::uint64_t id = 0;
  static_assert(sizeof(system.f_fsid) == sizeof(id));
  std::memcpy(&id, &system.f_fsid, sizeof(id));
  return mixed({folder.st_dev, folder.st_ino, id, static_cast<std::uint64_t>(system.f_type)});
}

EntryKind kind_of(mode_t mode) {
  if (S_ISDIR(mode)) return EntryKind::kFolder;
  return S_ISREG(mode) ? EntryKind::kFile : EntryKind::kOther;
}

}  // namespace

const std::string LinuxDisk::kLockFile = ".nodal-lock";

Result<std::unique_ptr<LinuxDisk>> LinuxDisk::open(const std::string& root) {
  std::unique_ptr<LinuxDisk> disk(new LinuxDisk(root, false));
  disk->may_make_ = true;
  NODAL_TRY_ASSIGN(auto fd, disk->open_root());
  disk->root_ = std::move(fd);
  return disk;
}

std::unique_ptr<LinuxDisk> LinuxDisk::guest(const std::string& root, bool mounted) {
  std::unique_ptr<LinuxDisk> disk(new LinuxDisk(root, mounted));
  disk->guest_ = true;
  disk->may_make_ = !mounted;
  return disk;
}

LinuxDisk::~LinuxDisk() = default;

Result<Descriptor> LinuxDisk::open_root() const {
  Descriptor fd(::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd && errno == ENOENT && may_make_) {
    std::error_code error;
    std::filesystem::create_directories(path_, error);
    if (error) return fail(Errc::kIo, "folder '" + path_ + "': cannot be made: " + error.message());
    fd = Descriptor(::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  }
  if (!fd) {
    const bool no_disk = mounted_ && errno == ENOENT;
    if (no_disk) return fail(not_mounted());
    return fail(Errc::kIo, "folder '" + path_ + "': cannot be opened: " + std::strerror(errno));
  }
  if (!mounted_) return fd;
  struct stat inside {
  }, outside{};
  if (::fstat(fd.get(), &inside) != 0 || ::fstatat(fd.get(), "..", &outside, 0) != 0 ||
      inside.st_dev == outside.st_dev) {
    return fail(not_mounted());
  }
  return fd;
}

Error LinuxDisk::not_mounted() const {
  return {Errc::kNotReady, "folder '" + path_ + "': no disk is mounted there; mount the card"};
}

Result<LinuxDisk::Root> LinuxDisk::folder() const {
  if (root_) return Root{root_.get(), Descriptor()};
  NODAL_TRY_ASSIGN(auto fd, open_root());
  const int number = fd.get();
  return Root{number, std::move(fd)};
}

Status LinuxDisk::claim() {
  if (lock_) return {};
  NODAL_TRY_ASSIGN(auto root, folder());
  constexpr int kFlags = O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC;
  Descriptor lock(::openat(root.get(), kLockFile.c_str(), kFlags, kLockMode));
  if (!lock) return fail(failure("opening it", kLockFile, errno));
  struct stat about {};
  if (::fstat(lock.get(), &about) < 0) return fail(failure("opening it", kLockFile, errno));
  if (!S_ISREG(about.st_mode)) return fail(Errc::kIo, "file '" + path_ + "/" + kLockFile + "': is not a file");
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK) return fail(Errc::kBusy, "folder '" + path_ + "': another nodald uses it");
    return fail(failure("locking it", kLockFile, errno));
  }
  lock_ = std::move(lock);
  if (guest_) root_ = std::move(root.own);
  return {};
}

void LinuxDisk::release() {
  lock_ = Descriptor();
  if (guest_) root_ = Descriptor();
}

Result<std::uint64_t> LinuxDisk::identity() {
  struct stat inside {
  }, outside{};
  struct statfs system {};
  // By name, so that nothing is open, not for a moment, while somebody unmounts it.
  if (::stat(path_.c_str(), &inside) != 0 || ::statfs(path_.c_str(), &system) != 0) {
    if (mounted_) return fail(not_mounted());
    return fail(Errc::kNotFound, "folder '" + path_ + "': is not there");
  }
  if (mounted_ && (::stat((path_ + "/..").c_str(), &outside) != 0 || inside.st_dev == outside.st_dev)) {
    return fail(not_mounted());
  }
  return identity_of(inside, system);
}

/// The folders of two names, and a check that neither is a folder itself.
Status LinuxDisk::rename_as(const std::string& from, const std::string& to, unsigned flags) {
  NODAL_TRY(check_name(from));
  NODAL_TRY(check_name(to));
  NODAL_TRY_ASSIGN(const auto from_folder, open_beneath(folder_of(from), O_PATH | O_DIRECTORY, "renaming it"));
  NODAL_TRY_ASSIGN(const auto to_folder, open_beneath(folder_of(to), O_PATH | O_DIRECTORY, "renaming it"));
  struct stat about {};
  for (const auto& [folder, name] : {std::pair{&from_folder, &from}, std::pair{&to_folder, &to}}) {
    if (::fstatat(folder->get(), last_part(*name), &about, AT_SYMLINK_NOFOLLOW) == 0 && S_ISDIR(about.st_mode)) {
      if (name == &to && flags != 0) return fail(failure("renaming it", to, EEXIST));
      return fail(Errc::kUnsupported, "file '" + path_ + "/" + *name + "': folders are not renamed or replaced");
    }
  }
  if (::renameat2(from_folder.get(), last_part(from), to_folder.get(), last_part(to), flags) == 0) return {};
  if (errno != EINVAL || flags == 0) return fail(failure("renaming it", errno == EEXIST ? to : from, errno));
  // A file system without RENAME_NOREPLACE. The folder is claimed, so nobody makes the name in between.
  if (::fstatat(to_folder.get(), last_part(to), &about, AT_SYMLINK_NOFOLLOW) == 0) {
    return fail(failure("renaming it", to, EEXIST));
  }
  if (::renameat(from_folder.get(), last_part(from), to_folder.get(), last_part(to)) == 0) return {};
  return fail(failure("renaming it", from, errno));
}

Status LinuxDisk::rename(const std::string& from, const std::string& to) { return rename_as(from, to, 0); }

Status LinuxDisk::rename_new(const std::string& from, const std::string& to) {
  return rename_as(from, to, RENAME_NOREPLACE);
}

Status LinuxDisk::remove(const std::string& name) {
  NODAL_TRY(check_name(name));
  NODAL_TRY_ASSIGN(const auto folder, open_beneath(folder_of(name), O_PATH | O_DIRECTORY, "removing it"));
  if (::unlinkat(folder.get(), last_part(name), 0) == 0) return {};
  if (errno != EISDIR) return fail(failure("removing it", name, errno));
  if (::unlinkat(folder.get(), last_part(name), AT_REMOVEDIR) < 0) return fail(failure("removing it", name, errno));
  return {};
}

Status LinuxDisk::make_folder(const std::string& name) {
  NODAL_TRY(check_name(name));
  NODAL_TRY_ASSIGN(const auto folder, open_beneath(folder_of(name), O_PATH | O_DIRECTORY, "making it"));
  if (::mkdirat(folder.get(), last_part(name), kFolderMode) == 0) return {};
  return fail(failure("making it", name, errno));
}

Status LinuxDisk::sync_folder(const std::string& name) {
  if (!name.empty()) {
    NODAL_TRY(check_name(name));
  }
  NODAL_TRY_ASSIGN(const auto folder, open_beneath(name.empty() ? "." : name, O_RDONLY | O_DIRECTORY, "syncing it"));
  if (again_when_interrupted([&] { return ::fsync(folder.get()); }) < 0) {
    return fail(failure("syncing it", name, errno));
  }
  return {};
}

Result<std::vector<std::string>> LinuxDisk::list(const std::string& folder) {
  NODAL_TRY_ASSIGN(auto found, entries(folder));
  return FolderListing::names_of(std::move(found));
}

Result<std::vector<FolderEntry>> LinuxDisk::entries(const std::string& folder) {
  if (!folder.empty()) {
    NODAL_TRY(check_name(folder));
  }
  NODAL_TRY_ASSIGN(auto fd, open_beneath(folder.empty() ? "." : folder, O_RDONLY | O_DIRECTORY, "listing it"));
  DIR* const stream = ::fdopendir(fd.get());
  if (stream == nullptr) return fail(failure("listing it", folder, errno));
  fd.release();  // the stream now closes it
  FolderListing found(folder.empty() ? path_ : path_ + "/" + folder);
  Status added;
  errno = 0;
  while (const dirent* entry = added ? ::readdir(stream) : nullptr) {
    const std::string name = entry->d_name;
    struct stat about {};
    // What was removed meanwhile is left out.
    if (name != "." && name != ".." && ::fstatat(::dirfd(stream), entry->d_name, &about, AT_SYMLINK_NOFOLLOW) == 0)
      added = found.add({name, kind_of(about.st_mode), version_of(about)});
    errno = 0;
  }
  const int error = errno;
  ::closedir(stream);
  if (!added) return fail(added.error());
  if (error != 0) return fail(failure("listing it", folder, error));
  return std::move(found).entries();
}

Result<std::uint64_t> LinuxDisk::free_bytes() {
  NODAL_TRY_ASSIGN(const auto root, folder());
  struct statvfs about {};
  if (::fstatvfs(root.get(), &about) < 0) return fail(failure("asking for free room", "", errno));
  return static_cast<std::uint64_t>(about.f_bavail) * about.f_frsize;
}

Result<std::uint64_t> LinuxDisk::total_bytes() {
  NODAL_TRY_ASSIGN(const auto root, folder());
  struct statvfs about {};
  if (::fstatvfs(root.get(), &about) < 0) return fail(failure("asking for its size", "", errno));
  return static_cast<std::uint64_t>(about.f_blocks) * about.f_frsize;
}

}  // namespace nodal::hal::linux_os
