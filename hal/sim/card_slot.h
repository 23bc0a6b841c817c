// A place for disks that people exchange, with as many ports as there are programs that use it.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hal/sim/disk.h"

namespace nodal::hal::sim {

/// Ports behave as a folder on which disks are mounted: a claim and a handle stay with the disk that was there, also if
/// it is exchanged meanwhile, as after `umount -l`. A disk that is pulled is gone for them.
///
/// Threading: thread-bound; all ports are on one thread.
/// Ownership: ports and the slot share the disks; ports may outlive the slot.
/// Errors: as DiskPort; kNotReady while the slot is empty.
class SimCardSlot {
 public:
  SimCardSlot() : place_(std::make_shared<Place>()) {}

  std::unique_ptr<DiskPort> port() const;

  // What the test does.
  /// Puts a disk in the place of the one that is there, which stays good for its claims and handles.
  void insert(std::shared_ptr<SimDisk> disk) { place_->disk = std::move(disk); }
  /// Takes the disk out of the slot, under the hands of whoever uses it.
  void pull();
  const std::shared_ptr<SimDisk>& disk() const { return place_->disk; }

 private:
  struct Place {
    std::shared_ptr<SimDisk> disk;
  };
  class Port;

  const std::shared_ptr<Place> place_;
};

}  // namespace nodal::hal::sim
