/* daemon/publish/hooks_env.h - inside hooks: the environment that tells a program what happened. */
#ifndef SST_DAEMON_PUBLISH_HOOKS_ENV_H
#define SST_DAEMON_PUBLISH_HOOKS_ENV_H

#include "base/base.h"

/**
 * Environment for one event: ours without what is between systemd and the service, and SST_....
 *
 * @param event  line of JSON, of sst_events_next()
 * @return ended by NULL; to free with sst_hook_env_free(); NULL: no memory, or `event` is no such line
 */
char **sst_hook_env(const char *event);
void sst_hook_env_free(char **env);

#endif
