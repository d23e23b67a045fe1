/* Places for downloads, and who loses his: with all of them taken, the slowest reader below a minimum makes room.
 *
 * A reader's clock runs while he is waited for, not while the disk is. What he has taken is what was handed to his
 * connection less what still lies in its socket, so that deep buffers make nobody fast. */
#include "daemon/publish/publish_internal.h"

#if WITH_HTTPD

#include <errno.h>
#include <linux/sockios.h>
#include <string.h>
#include <sys/ioctl.h>

#include "base/clock.h"
#include "base/thread.h"

#define WAIT_NS   (SST_READER_WINDOW_NS + 2000000000) /* for a place: in this time who is slow can be known */
#define REPORT_NS 60000000000LL                       /* between events about slow readers */

/* --- how fast somebody reads -------------------------------------------------------------------------------------- */

/* @param clock_ns  of the reader; taken: bytes until now */
void http_throughput_mark(struct http_pace *p, int64_t clock_ns, uint64_t taken)
{
    if (clock_ns - p->late.clock_ns < SST_READER_WINDOW_NS)
        return;
    p->early = p->late;
    p->late = (struct http_pace_mark){ clock_ns, taken };
}

double http_throughput(const struct http_pace *p, int64_t clock_ns, uint64_t taken)
{
    const int64_t ns = clock_ns - p->early.clock_ns;

    if (ns < SST_READER_WINDOW_NS)
        return -1;
    return taken > p->early.taken ? (double)(taken - p->early.taken) * 1e9 / (double)ns : 0;
}

static int64_t clock_of(const struct http_reader *r, int64_t now_ns)
{
    return r->clock_ns + (r->since_ns ? now_ns - r->since_ns : 0);
}

static uint64_t taken_of(const struct http_link *l)
{
    int queued = 0;

    if (ioctl(l->fd, SIOCOUTQ, &queued) || queued < 0)
        queued = 0;
    return l->reader.given > (uint64_t)queued ? l->reader.given - (uint64_t)queued : 0;
}

void http_reader_waits(struct sst_http *http, struct http_link *l)
{
    struct http_reader *r = &l->reader;
    const int64_t now_ns = sst_clock_now_ns();

    pthread_mutex_lock(&http->lock);
    r->clock_ns = clock_of(r, now_ns);
    r->since_ns = 0;
    pthread_mutex_unlock(&http->lock);
}

void http_reader_given(struct sst_http *http, struct http_link *l, size_t n)
{
    pthread_mutex_lock(&http->lock);
    l->reader.given += n;
    l->reader.since_ns = sst_clock_now_ns();
    pthread_mutex_unlock(&http->lock);
}

void http_readers_mark_locked(struct sst_http *http, int64_t now_ns)
{
    for (struct http_link *l = http->links; l; l = l->next) {
        if (l->reader.placed)
            http_throughput_mark(&l->reader.pace, clock_of(&l->reader, now_ns), taken_of(l));
    }
}

/* --- places ------------------------------------------------------------------------------------------------------- */

static bool is_same(const struct http_reader *a, const struct http_reader *b)
{
    return !a->local && !b->local && !memcmp(a->network, b->network, sizeof(a->network));
}

/* @param of_his  out, of the same address @return readers in all */
static int count_locked(struct sst_http *http, const struct http_reader *r, int *of_his, int *leaving)
{
    int n = 0;

    *of_his = *leaving = 0;
    for (struct http_link *l = http->links; l; l = l->next) {
        if (!l->reader.placed)
            continue;
        n++;
        *of_his += is_same(&l->reader, r);
        *leaving += l->reader.dropped;
    }
    return n;
}

/* The slowest below the minimum; of his own address, where that has too many. */
static struct http_link *find_slow_locked(struct sst_http *http, const struct http_reader *r, bool his_own,
                                          int64_t now_ns)
{
    struct http_link *slowest = NULL;
    double least = SST_READER_LEAST;

    for (struct http_link *l = http->links; l; l = l->next) {
        double pace;

        if (!l->reader.placed || l->reader.dropped || (his_own && !is_same(&l->reader, r)))
            continue;
        pace = http_throughput(&l->reader.pace, clock_of(&l->reader, now_ns), taken_of(l));
        if (pace < 0 || pace >= least)
            continue;
        least = pace;
        slowest = l;
    }
    return slowest;
}

/* @return true: there is a place */
static bool look_locked(struct sst_http *http, const struct http_reader *r, bool *dropped)
{
    int of_his, leaving;
    const int all = count_locked(http, r, &of_his, &leaving);
    const bool his_own = of_his >= SST_DOWNLOADS_ADDRESS;
    struct http_link *slow;

    if (all < SST_DOWNLOADS_MAX && !his_own)
        return true;
    slow = leaving < http->waiting ? find_slow_locked(http, r, his_own, sst_clock_now_ns()) : NULL;
    if (slow) {
        slow->reader.dropped = true;
        shutdown(slow->fd, SHUT_RDWR); /* its thread wakes and gives the place back */
        atomic_fetch_add(&http->slow, 1);
        *dropped = true;
    }
    return false;
}

static void tell_dropped(struct sst_http *http)
{
    const int64_t now_ns = sst_clock_now_ns();
    bool report;

    pthread_mutex_lock(&http->lock);
    report = !http->slow_ns || now_ns - http->slow_ns > REPORT_NS;
    http->slow_ns = report ? now_ns : http->slow_ns;
    pthread_mutex_unlock(&http->lock);
    if (report)
        sst_events_emit(
            http->cfg.api->events, SST_EVENT_WARNING, "client", json_pack("{s:s}", "reason", "slow download"),
            "all places for downloads were taken: one below %d kB/s was ended for another", SST_READER_LEAST / 1000);
}

int http_reader_begin(struct http_request *q)
{
    struct sst_http *http = q->http;
    struct http_reader r = { .placed = true, .local = q->local };
    const int64_t until_ns = sst_clock_now_ns() + WAIT_NS;
    bool dropped = false, place;

    http_network(q, r.network);
    pthread_mutex_lock(&http->lock);
    http->waiting++;
    while (!(place = look_locked(http, &r, &dropped)) && !atomic_load(&http->stopping) && !http_peer_gone(q->fd) &&
           sst_clock_now_ns() < until_ns)
        (void)sst_cond_wait_until(&http->wake, &http->lock, sst_clock_now_ns() + HTTP_WAIT_MS * 1000000LL);
    http->waiting--;
    if (place)
        q->link->reader = r;
    pthread_mutex_unlock(&http->lock);
    if (dropped)
        tell_dropped(http);
    return place ? 0 : -EMFILE;
}

void http_reader_end(struct sst_http *http, struct http_link *l)
{
    pthread_mutex_lock(&http->lock);
    l->reader = (struct http_reader){ .placed = false };
    pthread_cond_broadcast(&http->wake);
    pthread_mutex_unlock(&http->lock);
}

#endif
