# The installed service under a systemd of its own: the unit starts, sees its cameras from inside its sandbox and little
# else, reloads, comes back after a kill, stays down with a faulty configuration, and is started by its socket.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. tests/guest/lib.sh
repo=$OLDPWD
[ -x /lib/systemd/systemd ] || skip "systemd is not installed on the host"

load vivid n_devs=4 node_types=0x1,0x1,0x1,0x1 multiplanar=1,1,1,1 num_inputs=1,1,1,1 input_types=0,0,0,0
wait_for 30 test -e /dev/video3 || fail "4 nodes do not appear"

export PATH=/usr/local/sbin:/usr/local/bin:$PATH

# A root of its own: the host's /usr, all else in memory; the service goes to /usr/local.
new=$tmp/new
mkdir $new
mount -t tmpfs -o mode=755 root $new
mkdir -p $new/{dev,etc,home/someone,proc,repo,root,run,sys,tmp,usr,var/lib}
for l in bin sbin lib lib64; do ln -s usr/$l $new/$l; done
cp -a /etc/{passwd,group,ld.so.cache,nsswitch.conf,alternatives} $new/etc/
echo 0123456789abcdef0123456789abcdef >$new/etc/machine-id
mount --bind /usr $new/usr
mount -t tmpfs -o mode=755 local $new/usr/local
mount --rbind /dev $new/dev
mount -t sysfs sysfs $new/sys
mkdir -p $new/etc/systemd/system
# The machine has booted as far as the test needs it.
for unit in systemd-{udevd,udev-trigger,hwdb-update,random-seed,binfmt,sysctl,update-utmp,update-utmp-runlevel,logind,timesyncd,networkd,pstore,boot-update,journal-flush,firstboot,machine-id-commit,remount-fs,ask-password-console,ask-password-wall}.service \
  {systemd-udevd-control,systemd-udevd-kernel,systemd-initctl}.socket \
  {dev-hugepages,dev-mqueue,sys-kernel-config,sys-kernel-debug,sys-kernel-tracing,sys-fs-fuse-connections}.mount \
  modprobe@.service proc-sys-fs-binfmt_misc.automount kmod-static-nodes.service getty.target ldconfig.service; do
  ln -s /dev/null $new/etc/systemd/system/$unit
done
(cd "$repo" && BUILD=${SST_BUILD:-build} PREFIX=/usr/local SYSCONFDIR=/etc DESTDIR=$new bash scripts/install.sh install) || fail "install"
cat >$new/etc/sst/sstd.yaml <<'Y'
array: { rows: 2, cols: 2 }
cameras: { format: GREY, width: 320, height: 180, rate_hz: 2, stall_ms: 8000 }
sets: { wait_ms: 900 }
live: { enabled: false }
rtsp: { enabled: false }
storage: { ring_mb: 16, min_free_gb: 0 }
Y
# Its first process; PID 1 of its own processes, in the machine's one tree of control groups.
container=test unshare --mount --pid --fork --kill-child --propagation private sh -c "
  cd $new && mount -t proc proc proc && mount --move . / && exec chroot . /lib/systemd/systemd --system --unit=basic.target \
    --show-status=no --log-target=kmsg" >systemd.log 2>&1 &
wait_for 60 pgrep -x systemd || fail "no systemd: $(cat systemd.log)"
pid1=$(pgrep -x systemd | head -n 1)
box() { nsenter -t "$pid1" -m -p -r -w -- "$@"; }
basic() { [ "$(box systemctl is-active basic.target)" = active ]; }
wait_for 200 basic || { fail "systemd does not come up: $(box systemctl list-jobs; tail -n 5 systemd.log)"; exit 1; }
box systemctl --failed --no-legend

show() { box systemctl show -P "$1" sstd; }
journal() { box journalctl -q --no-pager -o cat -u sstd "$@"; }
state() { box sst status --json >status.json 2>err && [ "$(json status.json 'j["state"]')" = "$1" ]; }

# Up, and capturing from inside.
box systemctl start sstd || fail "start: $(journal | tail -n 5)"
is "state of the unit" "$(show ActiveState)" active
wait_for 60 state capturing || fail "it does not capture: $(cat status.json err; journal | tail)"
holds status.json 'j["capture"]["present"] == 4'
box systemctl status sstd >unit.txt
says unit.txt "capturing" "cameras"
box sst status
box sst cameras
main=$(show MainPID)
is "the socket that it made" "$(box stat -c '%U %G %a' /run/sst/control.sock)" "sst sst 660"
journal >journal.txt
grep 'Operation not permitted' journal.txt && fail "the sandbox keeps it from something"
is "its user" "$(box stat -c %U /proc/$main)" sst
box journalctl -q --no-pager -u sstd SST_EVENT=start -o json >start.json || fail "no start in the journal"
says start.json '"MESSAGE_ID"' '"SST_EVENT":"start"'

# Its view of the devices: as its user, in its namespace and its control group.
cgroup=/sys/fs/cgroup$(show ControlGroup)
inside() {
  box sh -c "echo \$\$ >$cgroup/cgroup.procs && exec nsenter -t $main -m -- setpriv --reuid=sst --regid=sst \
    --groups=$(box id -G sst | tr ' ' ,),$(box getent group video gpio dialout plugdev | cut -d: -f3 | paste -sd,) \"\$@\"" sh "$@"
}
inside sh -c ': </dev/video0' || fail "no camera"
inside sh -c ': >>/var/lib/sst/try && rm /var/lib/sst/try' || fail "its folder cannot be written"
inside sh -c ': >/etc/sst/try' 2>/dev/null && fail "/etc can be written"
inside sh -c ': >/usr/local/try' 2>/dev/null && fail "/usr/local can be written"
inside ls /home/someone >/dev/null 2>&1 && fail "/home is seen"
inside test -e /proc/1/cmdline && fail "processes of others are seen"
box chmod 666 /dev/kmsg
inside sh -c ': >/dev/kmsg' 2>/dev/null && fail "/dev/kmsg can be opened"
# The recovery ladder's files: the ones that udev gave to group video, and no more.
usb=/sys/devices/platform/vivid.0/uevent
chgrp video $usb && chmod 664 $usb
inside sh -c ": >$usb" || fail "a file of the group below /sys/devices cannot be written"
chmod 644 $usb
inside sh -c ": >$usb" 2>/dev/null && fail "a file of root below /sys can be written"
box chmod 666 /sys/kernel/mm/ksm/run
inside sh -c ': >/sys/kernel/mm/ksm/run' 2>/dev/null && fail "/sys beside devices can be written"

# Reload: a change is applied; a fault is refused, and the service goes on.
box sed -i 's/wait_ms: 900/wait_ms: 800/' /etc/sst/sstd.yaml
box systemctl reload sstd || fail "reload: $(journal | tail -n 5)"
box sed -i 's/rows: 2/rows: two/' /etc/sst/sstd.yaml
box systemctl reload sstd 2>err && fail "a faulty configuration was reloaded"
is "state after a refused reload" "$(show ActiveState)" active
journal >journal.txt
says journal.txt "sstd.yaml:1:" "two"

# Killed: back, and capturing again. (The file is still faulty: it is put right first.)
box sed -i 's/rows: two/rows: 2/' /etc/sst/sstd.yaml
kill -9 "$(pgrep -x sstd)"
again() { [ "$(show NRestarts)" = 1 ] && [ "$(show ActiveState)" = active ] && state capturing; }
wait_for 60 again || fail "not back after a kill: $(show ActiveState) $(journal | tail -n 5)"

# Stopped in time; a faulty configuration ends it for good.
start=$(date +%s%N)
box systemctl stop sstd || fail "stop"
echo "stopped after $((($(date +%s%N) - start) / 1000000)) ms"
is "result of the stop" "$(show Result)" success
box sed -i 's/rows: 2/rows: two/' /etc/sst/sstd.yaml
box systemctl start sstd 2>err && fail "started with a faulty configuration"
sleep 5
is "state with a faulty configuration" "$(show ActiveState)" failed
is "its status" "$(show ExecMainStatus)" 78
box sed -i 's/rows: two/rows: 2/' /etc/sst/sstd.yaml

# By its socket: a question starts it.
box systemctl reset-failed sstd
box systemctl start sstd.socket || fail "socket"
is "the socket" "$(box stat -c '%U %G %a' /run/sst/control.sock)" "sst sst 660"
wait_for 60 state capturing || fail "not started by a question: $(cat err; journal | tail -n 5)"
box systemctl stop sstd.socket sstd
journal -p warning | sort | uniq -c | sort -rn | head -n 20
kill -KILL "$pid1" # SIGTERM would have it start anew
exit $failed
