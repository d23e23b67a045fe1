/* simulators/devices/usbfs.c - /dev/bus/usb/BBB/DDD: claims, transfers, resets. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <linux/usbdevice_fs.h>

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "simulators/devices/devices_internal.h"
#include "simulators/devices/usb_internal.h"

#define REAPERS 8 /* threads that wait in USBDEVFS_REAPURB */

struct transfer {
    struct transfer *next;
    struct sst_sim_usb_transfer t;
    bool done;
    uint8_t data[]; /* [SST_SIM_USB_BULK_MAX], of control transfers [SST_SIM_USB_TRANSFER_MAX] */
};

struct usb_file {
    struct usb_shown *shown;
    struct sim_handle *handle;
    struct transfer *transfers; /* in the order of their submission */
    struct sim_request *waiting[REAPERS];
    int reapers;
    size_t position; /* of read() */
    unsigned cut;    /* mask of endpoints on which a short packet ended a split transfer */
    struct usb_file *next;
};

static const struct sst_sim_usb_device *device_of(const struct usb_file *f)
{
    return sst_sim_usb_device(f->shown->front->usb, f->shown->device);
}

/* --- transfers ---------------------------------------------------------------------------------------------------- */

/** Bytes that the program gets back: none of its own. */
static size_t received(const struct transfer *t)
{
    const bool in = t->t.type == USBDEVFS_URB_TYPE_CONTROL ? t->t.setup[0] & 0x80 : t->t.endpoint & 0x80;

    return in ? (size_t)t->t.actual : 0;
}

/** Reap the oldest completed transfer. @return 0 or -EAGAIN */
static int reap(struct usb_file *f, struct sim_request *r)
{
    for (struct transfer **link = &f->transfers; *link; link = &(*link)->next) {
        struct transfer *t = *link;

        if (!t->done)
            continue;
        memcpy(r->data, &t->t, sizeof(t->t));
        memcpy(r->data + sizeof(t->t), t->data, received(t));
        r->out_bytes = (uint32_t)(sizeof(t->t) + received(t));
        *link = t->next;
        free(t);
        return 0;
    }
    return -EAGAIN;
}

/** Emptying the socket makes it writable for poll(): see preload/usb.c. */
static void signal_done(struct usb_file *f)
{
    char gone[4096];

    if (f->reapers > 0) {
        struct sim_request *r = f->waiting[--f->reapers];

        sst_sim_answer(f->handle->server, r, reap(f, r));
        return;
    }
    while (recv(f->handle->fd, gone, sizeof(gone), MSG_DONTWAIT) > 0)
        ;
}

static bool is_still(const struct usb_file *f)
{
    return device_of(f)->kind == SST_SIM_USB_STILL && f->shown->front->pipes.in;
}

static void finish(struct transfer *t, int status, int actual)
{
    t->t.status = status;
    t->t.actual = actual;
    t->done = true;
}

/** Finish a transfer, which a waiting program may take with it: it is not used afterwards. */
static void complete(struct usb_file *f, struct transfer *t, int status, int actual)
{
    finish(t, status, actual);
    signal_done(f);
}

/**
 * Transfers longer than SST_SIM_USB_BULK_MAX arrive in pieces, all but the first marked as continuation. A piece that
 * is short ends the transfer: the pieces behind it are cancelled, and refused if they come later.
 * @return how many were cancelled
 */
static int cut_transfer(struct usb_file *f, const struct transfer *from)
{
    int cancelled = 0;

    f->cut |= 1u << (from->t.endpoint & 15);
    for (struct transfer *t = from->next;
         t && !(t->t.endpoint == from->t.endpoint && !(t->t.flags & USBDEVFS_URB_BULK_CONTINUATION)); t = t->next)
        if (!t->done && t->t.endpoint == from->t.endpoint) {
            finish(t, -ECONNRESET, 0);
            cancelled++;
        }
    return cancelled;
}

/** Fill transfers in the order of their submission, each endpoint for itself. */
static void serve_in(struct usb_file *f)
{
    const struct sim_usb_pipes *pipes = &f->shown->front->pipes;
    unsigned empty = 0;
    int done = 0;

    for (struct transfer *t = f->transfers; t; t = t->next) {
        const unsigned bit = 1u << (t->t.endpoint & 15);
        int n;

        if (t->done || t->t.type == USBDEVFS_URB_TYPE_CONTROL || !(t->t.endpoint & 0x80) || (empty & bit))
            continue;
        n = pipes->in(pipes->arg, t->t.endpoint, t->data, t->t.length);
        if (n == -EAGAIN) {
            empty |= bit;
        } else if (n < 0) {
            finish(t, n, 0);
            done++;
        } else {
            const bool cut = n < (int)t->t.length && (t->t.flags & USBDEVFS_URB_SHORT_NOT_OK);

            finish(t, cut ? -EREMOTEIO : 0, n);
            done += 1 + (cut ? cut_transfer(f, t) : 0);
        }
    }
    while (done-- > 0)
        signal_done(f);
}

void usb_file_serve(struct usb_shown *shown)
{
    for (struct usb_file *f = shown->files; f; f = f->next)
        serve_in(f);
}

/** Answer of the device to a control transfer. @return bytes or -errno */
static int ask_control(struct usb_file *f, const uint8_t setup[8], uint8_t *data)
{
    const struct sim_usb_pipes *pipes = &f->shown->front->pipes;

    if (is_still(f) && (setup[0] & 0x60) == 0x20)
        return pipes->request(pipes->arg, setup, data);
    return sst_sim_usb_control(f->shown->front->usb, f->shown->device, setup, data);
}

/** A transfer with a copy of its data, at the end of the list. NULL: no memory */
static struct transfer *append(struct usb_file *f, const struct sst_sim_usb_transfer *asked, size_t room,
                               const uint8_t *data, size_t bytes)
{
    struct transfer *t = calloc(1, sizeof(*t) + room), **link = &f->transfers;

    if (!t)
        return NULL;
    t->t = *asked;
    if (bytes)
        memcpy(t->data, data, bytes);
    while (*link)
        link = &(*link)->next;
    *link = t;
    return t;
}

/** A transfer of an endpoint beside control. Other devices than the still camera have nothing to report on theirs. */
static int submit_endpoint(struct usb_file *f, const struct sst_sim_usb_transfer *asked, const uint8_t *data,
                           size_t bytes)
{
    const struct sim_usb_pipes *pipes = &f->shown->front->pipes;
    const unsigned bit = 1u << (asked->endpoint & 15);
    const bool in = asked->endpoint & 0x80;
    struct transfer *t;

    if (asked->length > SST_SIM_USB_BULK_MAX || bytes < (in ? 0 : asked->length) ||
        (!is_still(f) && asked->type != USBDEVFS_URB_TYPE_INTERRUPT))
        return -EINVAL; /* pictures of other cameras are only available through the video node */
    if (asked->flags & USBDEVFS_URB_BULK_CONTINUATION) {
        if (f->cut & bit)
            return -EREMOTEIO;
    } else {
        f->cut &= ~bit;
    }
    t = append(f, asked, in ? asked->length : 0, NULL, 0);
    if (!t)
        return -ENOMEM;
    if (is_still(f) && !in) {
        const int err = pipes->out(pipes->arg, data, asked->length);

        complete(f, t, err, err ? 0 : (int)asked->length);
    }
    if (is_still(f))
        serve_in(f);
    return 0;
}

static int submit(struct usb_file *f, struct sim_request *r)
{
    const uint8_t *data = r->data + sizeof(struct sst_sim_usb_transfer);
    struct sst_sim_usb_transfer asked;
    struct transfer *t;
    size_t length, sent;
    int n;

    if (r->bytes < sizeof(asked))
        return -EINVAL;
    memcpy(&asked, r->data, sizeof(asked));
    if (asked.type == USBDEVFS_URB_TYPE_INTERRUPT || asked.type == USBDEVFS_URB_TYPE_BULK)
        return submit_endpoint(f, &asked, data, r->bytes - sizeof(asked));
    if (asked.type != USBDEVFS_URB_TYPE_CONTROL)
        return -EINVAL;
    length = (size_t)asked.setup[6] | (size_t)asked.setup[7] << 8;
    sent = asked.setup[0] & 0x80 ? 0 : length;
    if (length > SST_SIM_USB_TRANSFER_MAX || r->bytes < sizeof(asked) + sent)
        return -EINVAL;
    t = append(f, &asked, SST_SIM_USB_TRANSFER_MAX, data, sent);
    if (!t)
        return -ENOMEM;
    n = ask_control(f, t->t.setup, t->data);
    complete(f, t, sst_min_int(n, 0), sst_max_int(n, 0));
    return 0;
}

static int discard(struct usb_file *f, const struct sim_request *r)
{
    struct sst_sim_usb_transfer which;

    if (r->bytes < sizeof(which))
        return -EINVAL;
    memcpy(&which, r->data, sizeof(which));
    for (struct transfer *t = f->transfers; t; t = t->next) {
        if (t->t.user == which.user && !t->done) {
            complete(f, t, -ENOENT, 0);
            return 0;
        }
    }
    return -EINVAL;
}

/** USBDEVFS_CONTROL: a synchronous control transfer. */
static int control(struct usb_file *f, struct sim_request *r)
{
    struct sst_sim_usb_transfer t;
    uint8_t data[SST_SIM_USB_TRANSFER_MAX];
    size_t length;
    int n;

    if (r->bytes < sizeof(t))
        return -EINVAL;
    memcpy(&t, r->data, sizeof(t));
    length = (size_t)t.setup[6] | (size_t)t.setup[7] << 8;
    if (length > sizeof(data) || r->bytes < sizeof(t) + length)
        return -EINVAL;
    memcpy(data, r->data + sizeof(t), length);
    n = ask_control(f, t.setup, data);
    if (n >= 0 && (t.setup[0] & 0x80)) {
        memcpy(r->data + sizeof(t), data, (size_t)n);
        r->out_bytes = (uint32_t)(sizeof(t) + (size_t)n);
    }
    return n;
}

/* --- interfaces --------------------------------------------------------------------------------------------------- */

static bool has_interface(const struct usb_file *f, unsigned interface)
{
    return interface < (unsigned)device_of(f)->interfaces;
}

static int claim(struct usb_file *f, unsigned interface)
{
    if (!has_interface(f, interface))
        return -EINVAL;
    if (f->shown->claims[interface] == f)
        return 0;
    if (f->shown->claims[interface] || (device_of(f)->bound >> interface & 1))
        return -EBUSY;
    f->shown->claims[interface] = f;
    return 0;
}

static void let_go(struct usb_file *f, unsigned interface)
{
    const struct sim_usb_pipes *pipes = &f->shown->front->pipes;

    f->shown->claims[interface] = NULL;
    if (is_still(f))
        pipes->released(pipes->arg);
}

static int release(struct usb_file *f, unsigned interface)
{
    if (!has_interface(f, interface) || f->shown->claims[interface] != f)
        return -EINVAL;
    let_go(f, interface);
    return 0;
}

/** Disconnect the kernel's driver (-ENODATA: none) or connect it. @return number of drivers */
static int drive(struct usb_file *f, unsigned interface, bool on)
{
    int err;

    if (!has_interface(f, interface))
        return -EINVAL;
    if (on && f->shown->claims[interface])
        return -EBUSY;
    err = sst_sim_usb_bind(f->shown->front->usb, f->shown->device, (int)interface, on);
    if (!on)
        return err == -ENODEV ? -ENODATA : err;
    return err == 0 || err == -EBUSY ? 1 : err;
}

static int disconnect_claim(struct usb_file *f, const struct usbdevfs_disconnect_claim *c)
{
    const bool same = strncmp(c->driver, sst_sim_usb_driver(device_of(f)), sizeof(c->driver)) == 0;

    if (!has_interface(f, c->interface))
        return -EINVAL;
    if (device_of(f)->bound >> c->interface & 1) {
        if (((c->flags & USBDEVFS_DISCONNECT_CLAIM_IF_DRIVER) && !same) ||
            ((c->flags & USBDEVFS_DISCONNECT_CLAIM_EXCEPT_DRIVER) && same))
            return -EBUSY;
        (void)!drive(f, c->interface, false);
    }
    return claim(f, c->interface);
}

static int get_driver(const struct usb_file *f, struct sim_request *r)
{
    struct usbdevfs_getdriver *g = (void *)r->data;

    if (r->bytes < sizeof(*g) || !has_interface(f, g->interface))
        return -EINVAL;
    memset(g->driver, 0, sizeof(g->driver));
    if (f->shown->claims[g->interface])
        strcpy(g->driver, "usbfs");
    else if (device_of(f)->bound >> g->interface & 1)
        strcpy(g->driver, sst_sim_usb_driver(device_of(f)));
    else
        return -ENODATA;
    r->out_bytes = sizeof(*g);
    return 0;
}

/* --- about the device --------------------------------------------------------------------------------------------- */

static int reply(struct sim_request *r, const void *data, size_t bytes)
{
    memcpy(r->data, data, bytes);
    r->out_bytes = (uint32_t)bytes;
    return 0;
}

static int speed_of(const struct sst_sim_usb_device *d)
{
    return d->speed_mbit >= 5000 ? 5 : d->speed_mbit >= 480 ? 3 : 2; /* enum usb_device_speed of the kernel */
}

static int connection(const struct usb_file *f, struct sim_request *r)
{
    const struct sst_sim_usb_device *d = device_of(f);
    struct usbdevfs_conninfo_ex c = {
        .size = sizeof(c), .busnum = (uint32_t)d->bus, .devnum = (uint32_t)d->address, .speed = (uint32_t)speed_of(d)
    };
    const char *p = strchr(d->path, '-');

    while (d->kind != SST_SIM_USB_ROOT && p && c.num_ports < sizeof(c.ports)) {
        c.ports[c.num_ports++] = (uint8_t)atoi(p + 1);
        p = strchr(p + 1, '.');
    }
    return reply(r, &c, _IOC_SIZE(r->call.cmd) < sizeof(c) ? _IOC_SIZE(r->call.cmd) : sizeof(c));
}

static int set_interface(struct usb_file *f, const struct usbdevfs_setinterface *s)
{
    const struct sst_sim_usb_alt *alts;
    const int count = sst_sim_usb_alts(device_of(f)->speed_mbit, &alts);

    if (!has_interface(f, s->interface) || f->shown->claims[s->interface] != f)
        return -EINVAL;
    if (s->altsetting > (unsigned)(s->interface == 1 ? count : 0))
        return -EINVAL;
    return 0;
}

/* --- the file ----------------------------------------------------------------------------------------------------- */

static int wrapped(struct usb_file *f, const struct usbdevfs_ioctl *c)
{
    if (c->ioctl_code == (int)USBDEVFS_DISCONNECT || c->ioctl_code == (int)USBDEVFS_CONNECT)
        return drive(f, (unsigned)c->ifno, c->ioctl_code == (int)USBDEVFS_CONNECT);
    return -ENOTTY;
}

static int reap_or_wait(struct usb_file *f, struct sim_request *r)
{
    const int result = reap(f, r);

    if (result != -EAGAIN || r->call.cmd != (uint32_t)USBDEVFS_REAPURB)
        return result;
    if (f->reapers == REAPERS)
        return -ENOMEM;
    f->waiting[f->reapers++] = r;
    return SST_SIM_LATER;
}

static int file_ioctl(struct sim_handle *h, struct sim_request *r)
{
    struct usb_file *f = h->state;
    const uint32_t sizeless = ~((uint32_t)_IOC_SIZEMASK << _IOC_SIZESHIFT);
    const uint32_t capabilities = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION | USBDEVFS_CAP_CONNINFO_EX |
                                  USBDEVFS_CAP_DROP_PRIVILEGES;
    const struct sst_sim_usb_device *d = device_of(f);
    const struct usbdevfs_connectinfo info = { .devnum = (unsigned)d->address };
    unsigned number = 0;

    if (r->bytes >= sizeof(number))
        memcpy(&number, r->data, sizeof(number));
    if ((r->call.cmd & sizeless) == (USBDEVFS_CONNINFO_EX(0) & sizeless))
        return connection(f, r);
    switch (r->call.cmd) {
    case (uint32_t)USBDEVFS_CONTROL:
        return control(f, r);
    case (uint32_t)USBDEVFS_SUBMITURB:
        return submit(f, r);
    case (uint32_t)USBDEVFS_DISCARDURB:
        return discard(f, r);
    case (uint32_t)USBDEVFS_REAPURB:
    case (uint32_t)USBDEVFS_REAPURBNDELAY:
        return reap_or_wait(f, r);
    case (uint32_t)USBDEVFS_GET_CAPABILITIES:
        return reply(r, &capabilities, sizeof(capabilities));
    case (uint32_t)USBDEVFS_CONNECTINFO:
        return reply(r, &info, sizeof(info));
    case (uint32_t)USBDEVFS_GET_SPEED:
        return speed_of(d);
    case (uint32_t)USBDEVFS_GETDRIVER:
        return get_driver(f, r);
    case (uint32_t)USBDEVFS_CLAIMINTERFACE:
        return claim(f, number);
    case (uint32_t)USBDEVFS_RELEASEINTERFACE:
        return release(f, number);
    case (uint32_t)USBDEVFS_RESET:
        return sst_sim_usb_reset(f->shown->front->usb, f->shown->device);
    case (uint32_t)USBDEVFS_SETCONFIGURATION:
        return number <= 1 ? 0 : -EINVAL;
    case (uint32_t)USBDEVFS_CLEAR_HALT:
    case (uint32_t)USBDEVFS_RESETEP:
    case (uint32_t)USBDEVFS_DROP_PRIVILEGES:
        return 0;
    default:
        break;
    }
    if (r->bytes < _IOC_SIZE(r->call.cmd))
        return -EINVAL;
    switch (r->call.cmd) {
    case (uint32_t)USBDEVFS_IOCTL:
        return wrapped(f, (const void *)r->data);
    case (uint32_t)USBDEVFS_DISCONNECT_CLAIM:
        return disconnect_claim(f, (const void *)r->data);
    case (uint32_t)USBDEVFS_SETINTERFACE:
        return set_interface(f, (const void *)r->data);
    default:
        return -ENOTTY;
    }
}

/** The file's contents are the descriptors. */
static int file_read(struct sim_handle *h, struct sim_request *r)
{
    struct usb_file *f = h->state;
    uint8_t all[4096];
    const int bytes = sst_sim_usb_descriptors(f->shown->front->usb, f->shown->device, all, sizeof(all));
    size_t count;

    if (bytes < 0)
        return bytes;
    count = f->position < (size_t)bytes ? (size_t)bytes - f->position : 0;
    count = count < r->call.length ? count : r->call.length;
    memcpy(r->data, all + f->position, count);
    f->position += count;
    r->out_bytes = (uint32_t)count;
    return (int)count;
}

/** Seek from the start or the current position; usbfs does not support SEEK_END. */
static int file_seek(struct sim_handle *h, struct sim_request *r)
{
    struct usb_file *f = h->state;
    const int64_t to = (int64_t)r->call.arg + (r->call.cmd == SEEK_CUR ? (int64_t)f->position : 0);

    if ((r->call.cmd != SEEK_SET && r->call.cmd != SEEK_CUR) || to < 0)
        return -EINVAL;
    f->position = (size_t)to;
    r->out_arg = (uint64_t)to;
    return 0;
}

static int file_open(struct sim_handle *h, struct sim_request *r)
{
    static const char filler[1024];
    struct usb_file *f = calloc(1, sizeof(*f));

    if (!f)
        return -ENOMEM;
    f->shown = h->device;
    f->handle = h;
    h->state = f;
    f->next = f->shown->files;
    f->shown->files = f;
    /* Fill the socket: writable would mean that a transfer has completed. */
    while (send(r->out_fd, filler, sizeof(filler), MSG_DONTWAIT | MSG_NOSIGNAL) > 0)
        ;
    return 0;
}

static void file_cancel(struct sim_handle *h, struct sim_request *r)
{
    struct usb_file *f = h->state;

    for (int i = 0; i < f->reapers; i++)
        if (f->waiting[i] == r)
            f->waiting[i--] = f->waiting[--f->reapers];
}

static void file_close(struct sim_handle *h)
{
    struct usb_file *f = h->state;

    for (unsigned i = 0; i < ARRAY_LEN(f->shown->claims); i++)
        if (f->shown->claims[i] == f)
            let_go(f, i);
    SST_LIST_REMOVE(f->shown->files, f);
    while (f->transfers) {
        struct transfer *t = f->transfers;

        f->transfers = t->next;
        free(t);
    }
    free(f);
}

const struct sim_ops usb_file_ops = { .letter = 'u',
                                      .open = file_open,
                                      .close = file_close,
                                      .ioctl = file_ioctl,
                                      .read = file_read,
                                      .seek = file_seek,
                                      .cancel = file_cancel };
